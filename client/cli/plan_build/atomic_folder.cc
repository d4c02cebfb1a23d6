// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/plan_build/atomic_folder.h"

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <exception>
#include <fcntl.h>
#include <filesystem>
#include <string_view>
#include <unistd.h>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxAnswerBytes = 32768;  // fits into a pipe that nobody reads yet

// Without links and without a slash at the end, so that it has a name and a folder round it.
fs::path Resolved(const std::string& folder) {
  std::error_code error;
  const fs::path absolute = fs::weakly_canonical(fs::absolute(folder, error), error);
  return absolute.has_filename() ? absolute : absolute.parent_path();
}

absl::StatusOr<std::string> MakeTemporaryFolder(const fs::path& folder) {
  std::string name =
      (folder.parent_path() / absl::StrCat(".", folder.filename().string(), ".partial-XXXXXX"))
          .string();
  if (mkdtemp(name.data()) == nullptr) {
    return absl::ErrnoToStatus(errno, absl::StrCat("cannot make a folder beside ", folder.string(),
                                                   "; check permissions and free space"));
  }
  return name;
}

// mkdtemp lets nobody else in; the result is a folder like any other.
absl::Status Publish(const std::string& temporary, const fs::path& folder) {
  const mode_t mask = umask(0);
  umask(mask);
  if (chmod(temporary.c_str(), 0777 & ~mask) != 0 ||
      rename(temporary.c_str(), folder.c_str()) != 0) {
    return absl::ErrnoToStatus(
        errno, absl::StrCat("cannot put the result at ", folder.string(), "; name a new folder"));
  }
  return absl::OkStatus();
}

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

absl::Status CheckFillable(const std::string& folder) {
  const fs::path path = Resolved(folder);
  std::error_code error;
  if (fs::exists(path, error) && !(fs::is_directory(path, error) && fs::is_empty(path, error))) {
    return absl::AlreadyExistsError(
        absl::StrCat(folder, " is there already and not an empty folder; name a new one"));
  }
  if (path == fs::current_path(error)) {
    return absl::FailedPreconditionError(
        absl::StrCat(folder, " is the current folder; name a new one"));
  }
  const std::string parent = path.parent_path().string();
  if (!fs::is_directory(parent, error)) {
    return absl::NotFoundError(
        absl::StrCat("there is no folder ", parent, " for ", folder, "; make it first"));
  }
  if (access(parent.c_str(), W_OK | X_OK) != 0) {
    return absl::PermissionDeniedError(
        absl::StrCat("cannot write into ", parent, "; check its permissions"));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::string> FillFolderAtomically(
    const std::string& folder,
    const std::function<absl::StatusOr<std::string>(const std::string& temporary)>& work) {
  TF_RETURN_IF_ERROR(CheckFillable(folder));
  std::signal(SIGCHLD, SIG_DFL);
  const sigset_t signals = EndingSignals();
  sigset_t former;
  sigprocmask(SIG_BLOCK, &signals, &former);
  const absl::Cleanup unblock = [&former] { sigprocmask(SIG_SETMASK, &former, nullptr); };

  const fs::path path = Resolved(folder);
  TF_ASSIGN_OR_RETURN(const std::string temporary, MakeTemporaryFolder(path));
  const auto remove = [&temporary] {
    std::error_code error;
    fs::remove_all(temporary, error);
  };
  const absl::Cleanup remove_temporary = remove;  // gone already when all went well
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0) return absl::ErrnoToStatus(errno, "cannot make a pipe");
  const pid_t child = fork();
  if (child == 0) RunChild(ends[1], temporary, former, work);
  const int fork_error = errno;
  close(ends[1]);
  const absl::Cleanup close_pipe = [&ends] { close(ends[0]); };
  if (child < 0) return absl::ErrnoToStatus(fork_error, "cannot start a child process");

  int status = 0;
  if (const int signal = WaitForEnd(child, signals, &status); signal != 0) {
    EndGroup(child);
    remove();
    _exit(128 + signal);
  }
  TF_ASSIGN_OR_RETURN(std::string answer, Explain(status, ends[0]));
  TF_RETURN_IF_ERROR(Publish(temporary, path));
  return answer;
}

}  // namespace tissueform
