// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/online/server_process.h"

#include <array>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <thread>
#include <unistd.h>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include <sys/prctl.h>
#include <sys/wait.h>

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

using Clock = std::chrono::steady_clock;

constexpr char kListening[] = "listening on ";
constexpr std::chrono::seconds kEndDeadline{30};
constexpr std::chrono::milliseconds kEndPollInterval{5};
constexpr int kExecFailed = 127;

// In the child, between fork and exec: calls only what is safe there.
[[noreturn]] void BecomeServer(const char* binary, char* const* arguments, int output,
                               pid_t parent) {
  // A group of its own: Ctrl-C reaches the parent, which ends the server itself.
  setpgid(0, 0);
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() != parent) {
    _exit(kExecFailed);  // the parent ended before prctl
  }
  dup2(output, STDOUT_FILENO);
  execv(binary, arguments);
  _exit(kExecFailed);
}

}  // namespace

absl::StatusOr<std::unique_ptr<ServerProcess>> ServerProcess::Start(
    const std::string& binary, const std::vector<std::string>& arguments,
    std::chrono::milliseconds deadline) {
  if (access(binary.c_str(), X_OK) != 0) {
    return absl::NotFoundError(absl::StrCat("no program ", binary,
                                            "; build it (target tissueform-server) or install it "
                                            "beside tissueform"));
  }
  std::vector<std::string> words = {binary};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> pointers;
  pointers.reserve(words.size() + 1);
  for (std::string& word : words) {
    pointers.push_back(word.data());
  }
  pointers.push_back(nullptr);
  std::array<int, 2> pipe_ends{};
  if (pipe2(pipe_ends.data(), O_CLOEXEC) != 0) {
    return absl::ErrnoToStatus(errno, "cannot start the server");
  }
  const pid_t parent = getpid();
  const pid_t pid = fork();
  if (pid == 0) {
    BecomeServer(binary.c_str(), pointers.data(), pipe_ends[1], parent);
  }
  close(pipe_ends[1]);
  if (pid < 0) {
    close(pipe_ends[0]);
    return absl::ErrnoToStatus(errno, "cannot start the server");
  }
  std::unique_ptr<ServerProcess> process(new ServerProcess(pid, pipe_ends[0]));
  TF_RETURN_IF_ERROR(process->WaitUntilListening(deadline));
  return process;
}

ServerProcess::~ServerProcess() {
  close(output_);
  Terminate();
  if (!WaitForExit(kEndDeadline).has_value()) {
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
}

void ServerProcess::Terminate() {
  if (!exit_code_.has_value()) {
    kill(pid_, SIGTERM);
  }
}

std::optional<int> ServerProcess::WaitForExit(std::chrono::milliseconds deadline) {
  const auto end = Clock::now() + deadline;
  while (!exit_code_.has_value()) {
    int status = 0;
    if (waitpid(pid_, &status, WNOHANG) == pid_) {
      exit_code_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    } else if (Clock::now() >= end) {
      break;
    } else {
      std::this_thread::sleep_for(kEndPollInterval);
    }
  }
  return exit_code_;
}

absl::Status ServerProcess::WaitUntilListening(std::chrono::milliseconds deadline) {
  const auto end = Clock::now() + deadline;
  std::string text;
  while (!absl::StrContains(text, "\n")) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - Clock::now());
    pollfd readable{.fd = output_, .events = POLLIN, .revents = 0};
    if (left.count() <= 0 || poll(&readable, 1, static_cast<int>(left.count())) == 0) {
      return absl::UnavailableError("the server did not listen in time");
    }
    std::array<char, 256> buffer{};
    const ssize_t count = read(output_, buffer.data(), buffer.size());
    if (count > 0) {
      text.append(buffer.data(), count);
    } else if (count == 0) {
      return absl::UnavailableError("the server ended before it listened; see its message above");
    } else if (errno != EINTR) {
      return absl::ErrnoToStatus(errno, "cannot read from the server");
    } else {
      return absl::CancelledError("interrupted");
    }
  }
  absl::string_view line = absl::string_view(text).substr(0, text.find('\n'));
  if (!absl::ConsumePrefix(&line, kListening)) {
    return absl::InternalError("the server said something else than where it listens");
  }
  address_ = std::string(line);
  return absl::OkStatus();
}

}  // namespace tissueform
