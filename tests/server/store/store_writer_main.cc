// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <signal.h>
#include <string>
#include <unistd.h>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include <sys/time.h>

#include "server/platform/storage/fault_points.h"
#include "server/store/durable_store.h"
#include "tests/server/store/store_workload.h"

// The program that the crash tests kill. It opens the store in FOLDER, makes the steps of the
// workload and writes "a" to stdout for each that was acknowledged; before that "o", when it is
// open.
//
//   store_writer FOLDER STEPS point NAME COUNT   dies when it passes a fault point the COUNT-th
//   time store_writer FOLDER STEPS time MICROSECONDS  dies when so much time has passed since the
//   start
namespace tissueform {
namespace {

// What the hook looks for, set before there are other threads.
const char* point_name = nullptr;
std::atomic<int> passes_left = 0;

void Die() {
  kill(getpid(), SIGKILL);
  for (;;) pause();
}

void OnPoint(const char* name) {
  if (std::strcmp(name, point_name) == 0 && --passes_left == 0) Die();
}

void DieAfter(int64_t microseconds) {
  signal(SIGALRM, [](int) { kill(getpid(), SIGKILL); });
  itimerval timer{};
  timer.it_value.tv_sec = microseconds / 1'000'000;
  timer.it_value.tv_usec = microseconds % 1'000'000;
  setitimer(ITIMER_REAL, &timer, nullptr);
}

bool Say(char what) { return write(STDOUT_FILENO, &what, 1) == 1; }

int Fail(const absl::Status& status) {
  std::fprintf(stderr, "store_writer: %s\n", status.ToString().c_str());
  return EXIT_FAILURE;
}

int Write(const std::string& path, int steps) {
  auto folder = DataFolder::Open(path);
  if (!folder.ok()) return Fail(folder.status());
  const auto store = DurableStore::Open(*std::move(folder));
  if (!store.ok()) return Fail(store.status());
  if (!Say('o')) return EXIT_FAILURE;
  for (int number = 0; number < steps; ++number) {
    const absl::Status status = RunStep(number, /*bursts=*/true, **store);
    if (!status.ok()) return Fail(status);
    if (!Say('a')) return EXIT_FAILURE;
  }
  return EXIT_SUCCESS;
}

}  // namespace
}  // namespace tissueform

int main(int argc, char** argv) {
  int steps = 0;
  int64_t count = 0;
  if (argc < 5 || !absl::SimpleAtoi(argv[2], &steps) || !absl::SimpleAtoi(argv[argc - 1], &count)) {
    return EXIT_FAILURE;
  }
  if (std::strcmp(argv[3], "point") == 0) {
    tissueform::point_name = argv[4];
    tissueform::passes_left = static_cast<int>(count);
    tissueform::fault_hook = tissueform::OnPoint;
  } else {
    tissueform::DieAfter(count);
  }
  return tissueform::Write(argv[1], steps);
}
