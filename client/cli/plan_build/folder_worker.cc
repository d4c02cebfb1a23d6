// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/plan_build/folder_worker.h"

#include <array>
#include <cerrno>
#include <csignal>
#include <exception>
#include <fcntl.h>
#include <string_view>
#include <unistd.h>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include <sys/prctl.h>
#include <sys/wait.h>

#include "core/base/atomic_folder.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr size_t kMaxAnswerBytes = 32768;  // fits into a pipe that nobody reads yet

// One byte for the code, then the text.
void SendAnswer(int descriptor, const absl::StatusOr<std::string>& answer) {
  const std::string_view text = answer.ok() ? std::string_view(*answer)
                                            : std::string_view(answer.status().message().data(),
                                                               answer.status().message().size());
  std::string bytes(1, static_cast<char>(answer.status().code()));
  bytes += text.substr(0, kMaxAnswerBytes);
  if (write(descriptor, bytes.data(), bytes.size()) < 0) _exit(1);
}

absl::StatusOr<std::string> ReceiveAnswer(int descriptor) {
  std::string bytes;
  std::array<char, 4096> block{};
  ssize_t count = 0;
  while ((count = read(descriptor, block.data(), block.size())) > 0) {
    bytes.append(block.data(), static_cast<size_t>(count));
  }
  if (bytes.empty()) return absl::InternalError("the work ended without an answer");
  const auto code = static_cast<absl::StatusCode>(bytes.front());
  bytes.erase(0, 1);
  if (code == absl::StatusCode::kOk) return bytes;
  return absl::Status(code, bytes);
}

sigset_t EndingSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : {SIGINT, SIGTERM, SIGCHLD}) sigaddset(&signals, signal);
  struct sigaction hang_up {};
  sigaction(SIGHUP, nullptr, &hang_up);
  if (hang_up.sa_handler != SIG_IGN) sigaddset(&signals, SIGHUP);
  return signals;
}

// The signal that asks to end; 0 when the child has ended by itself.
int WaitForEnd(pid_t child, const sigset_t& signals, int* status) {
  for (;;) {
    const int signal = sigwaitinfo(&signals, nullptr);
    if (signal == SIGCHLD && waitpid(child, status, WNOHANG) == child) return 0;
    if (signal > 0 && signal != SIGCHLD) return signal;
  }
}

void EndGroup(pid_t child) {
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  // What the child has started; gently, so that a display takes its lock away.
  kill(-child, SIGTERM);
}

absl::StatusOr<std::string> Explain(int status, int descriptor) {
  if (WIFEXITED(status)) return ReceiveAnswer(descriptor);
  if (WTERMSIG(status) == SIGKILL) {
    return absl::ResourceExhaustedError(
        "the work was killed, perhaps for want of memory; nothing was written");
  }
  return absl::InternalError(
      absl::StrCat("a library crashed (signal ", WTERMSIG(status), "); nothing was written"));
}

[[noreturn]] void RunChild(
    int descriptor, const std::string& temporary, const sigset_t& former,
    const std::function<absl::StatusOr<std::string>(const std::string& temporary)>& work) {
  setpgid(0, 0);  // Ctrl-C goes to the parent alone, which ends the group in order
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  std::signal(SIGTTOU, SIG_IGN);
  sigprocmask(SIG_SETMASK, &former, nullptr);
  try {
    SendAnswer(descriptor, work(temporary));
  } catch (const std::exception& exception) {
    SendAnswer(descriptor, absl::InternalError(exception.what()));
  }
  _exit(0);
}

}  // namespace

absl::StatusOr<std::string> FillFolderAtomically(
    const std::string& folder,
    const std::function<absl::StatusOr<std::string>(const std::string& temporary)>& work) {
  std::signal(SIGCHLD, SIG_DFL);
  const sigset_t signals = EndingSignals();
  sigset_t former;
  sigprocmask(SIG_BLOCK, &signals, &former);
  const absl::Cleanup unblock = [&former] { sigprocmask(SIG_SETMASK, &former, nullptr); };

  absl::StatusOr<AtomicFolder> target = AtomicFolder::Create(folder);
  TF_RETURN_IF_ERROR(target.status());
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0) return absl::ErrnoToStatus(errno, "cannot make a pipe");
  const pid_t child = fork();
  if (child == 0) RunChild(ends[1], target->path(), former, work);
  const int fork_error = errno;
  close(ends[1]);
  const absl::Cleanup close_pipe = [&ends] { close(ends[0]); };
  if (child < 0) return absl::ErrnoToStatus(fork_error, "cannot start a child process");

  int status = 0;
  if (const int signal = WaitForEnd(child, signals, &status); signal != 0) {
    EndGroup(child);
    target = absl::CancelledError("");  // takes it away
    _exit(128 + signal);
  }
  TF_ASSIGN_OR_RETURN(std::string answer, Explain(status, ends[0]));
  TF_RETURN_IF_ERROR(target->Publish());
  return answer;
}

}  // namespace tissueform
