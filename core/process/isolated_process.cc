// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/process/isolated_process.h"

#include <cerrno>
#include <csignal>
#include <fcntl.h>
#include <unistd.h>

#include "absl/strings/str_cat.h"
#include <sys/wait.h>

namespace tissueform {
namespace {

void Silence() {
  const int nowhere = open("/dev/null", O_RDWR | O_CLOEXEC);
  for (const int descriptor : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    dup2(nowhere, descriptor);
  }
}

void ForgetSignalHandlers() {
  for (const int signal_number : {SIGSEGV, SIGBUS, SIGFPE, SIGABRT, SIGTERM, SIGINT}) {
    std::signal(signal_number, SIG_DFL);
  }
  std::signal(SIGPIPE, SIG_IGN);
}

// Never returns: nothing of the parent's state may be torn down twice.
[[noreturn]] void RunChild(int to_parent, const IsolationLimits& limits,
                           const std::function<bool(int descriptor)>& work) {
  Silence();
  ForgetSignalHandlers();
  BindToLimits(limits);
  const bool sent = work(to_parent);
  _exit(sent ? 0 : 1);
}

int WaitFor(pid_t child) {
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return status;
}

absl::Status ExplainEnd(absl::string_view what, int status, const IsolationLimits& limits) {
  if (WIFSIGNALED(status) && (WTERMSIG(status) == SIGXCPU || WTERMSIG(status) == SIGKILL)) {
    return absl::ResourceExhaustedError(
        absl::StrCat(what, " took more than ", limits.max_seconds, " seconds or all memory"));
  }
  return absl::InvalidArgumentError(
      absl::StrCat("it is damaged: the library crashed while ", what));
}

}  // namespace

absl::Status RunIsolated(absl::string_view what, const IsolationLimits& limits,
                         const std::function<bool(int descriptor)>& work,
                         const std::function<absl::Status(int descriptor)>& receive) {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) return absl::ErrnoToStatus(errno, "cannot make a pipe");
  const pid_t child = fork();
  if (child == 0) {
    // Else the child could not notice that the parent reads no further, and would wait for ever.
    close(ends[0]);
    RunChild(ends[1], limits, work);
  }
  const int fork_error = errno;
  close(ends[1]);
  if (child < 0) {
    close(ends[0]);
    return absl::ErrnoToStatus(fork_error, absl::StrCat("cannot start a child process for ", what));
  }
  const absl::Status received = receive(ends[0]);
  close(ends[0]);
  const int status = WaitFor(child);
  if (absl::IsDataLoss(received)) return ExplainEnd(what, status, limits);
  return received;
}

}  // namespace tissueform
