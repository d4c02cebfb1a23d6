// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// A helper program that behaves as its request says, and (with the argument "call") a program that
// calls it and waits.

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <new>
#include <stdexcept>
#include <string>
#include <unistd.h>
#include <vector>

#include "core/base/process/helper_call.h"
#include "core/base/process/helper_program.h"

namespace tissueform {
namespace {

constexpr int64_t kMaxBytes = 1 << 20;

absl::Status Behave(const std::string& behaviour) {
  if (behaviour == "be killed") raise(SIGKILL);
  if (behaviour == "crash") raise(SIGSEGV);
  if (behaviour == "abort") std::abort();
  if (behaviour == "leave") _exit(0);
  if (behaviour == "throw") throw std::runtime_error("odd");
  if (behaviour == "need memory") {
    return std::vector<char>(size_t{3} << 30).back() == 0 ? absl::OkStatus()
                                                          : absl::InternalError("not zero");
  }
  if (behaviour == "loop") {
    for (volatile bool forever = true; forever;) {
    }
  }
  if (behaviour == "chatter") {
    std::puts("chatter");
    std::fputs("chatter", stderr);
    std::fflush(stdout);
  }
  if (behaviour == "fail") return absl::NotFoundError("not here");
  const std::string kWrite = "write ";
  if (behaviour.rfind(kWrite, 0) == 0) {
    std::ofstream(behaviour.substr(kWrite.size())) << "contents";
  }
  return absl::OkStatus();
}

// The answer is the outcome, the helper's number, and the text of the request once more.
void Answer(const IsolationLimits& limits, PipeReceiver* request, PipeSender* answer) {
  const absl::StatusOr<std::string> behaviour = request->Text();
  const bool waits = behaviour.ok() && *behaviour == "tell and wait";
  answer->Outcome(WithoutExceptions("trying it", limits, [&] { return Behave(*behaviour); }));
  answer->Number(getpid());
  answer->Text(*behaviour);
  while (waits) pause();
}

// Starts a helper that waits, prints its number on stdout, and waits too.
int CallAndWait() {
  const HelperCall call{"process_test_helper", "trying it", {}};
  const absl::Status status = CallHelper(
      call, [](PipeSender* request) { request->Text("tell and wait"); },
      [](int descriptor) -> absl::Status {
        PipeReceiver receiver(descriptor, kMaxBytes);
        if (absl::Status outcome = receiver.Outcome(); !outcome.ok()) return outcome;
        std::cout << receiver.Number(INT32_MAX).value_or(-1) << std::endl;
        return receiver.Text().status().ok() ? receiver.Number(0).status() : absl::OkStatus();
      });
  std::cerr << status << "\n";
  return 1;
}

}  // namespace
}  // namespace tissueform

int main(int argc, char** argv) {
  if (argc > 1 && argv[1] == std::string("call")) return tissueform::CallAndWait();
  if (argc > 1 && argv[1] == std::string("leave")) return argc;
  if (argc > 1 && argv[1] == std::string("tell")) {
    std::string line;
    std::getline(std::cin, line);
    const char* value = std::getenv("TISSUEFORM_TEST_VALUE");
    char folder[4096];
    std::cout << line << "|" << (value == nullptr ? "" : value) << "|"
              << (getcwd(folder, sizeof(folder)) == nullptr ? "" : folder) << "|"
              << (getpgrp() == getpid() ? "own group" : "same group") << std::endl;
    while (argc > 2) pause();
    return 0;
  }
  return tissueform::RunHelperProgram(tissueform::Answer);
}
