// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/process/child_process.h"

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <fcntl.h>
#include <filesystem>
#include <spawn.h>
#include <thread>
#include <unistd.h>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include <sys/socket.h>
#include <sys/wait.h>

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

constexpr int kFirstOther = 3;  // descriptor after the standard streams
constexpr std::chrono::milliseconds kPollInterval{2};

// Closes what it holds. Every descriptor here is closed on exec and lies beyond the standard
// streams: a daemon may run without those, and an end of a pipe that got the number 0 would be
// overwritten while the child's streams are set.
class Descriptor {
 public:
  Descriptor() = default;
  explicit Descriptor(int number) : number_(number) {
    if (number_ < 0 || number_ >= kFirstOther) return;
    number_ = fcntl(number, F_DUPFD_CLOEXEC, kFirstOther);
    close(number);
  }
  Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }
  ~Descriptor() {
    if (number_ >= 0) close(number_);
  }

  int number() const { return number_; }
  int Release() { return std::exchange(number_, -1); }

 private:
  int number_ = -1;
};

// The child's end of a stream, and ours where it is a pipe.
struct Ends {
  Descriptor child;  // none when the stream is inherited
  Descriptor ours;
};

absl::Status SystemError(absl::string_view what) { return absl::ErrnoToStatus(errno, what); }

// A socket, not a pipe: only writes to a socket can suppress SIGPIPE, independently of how the
// program handles that signal.
absl::StatusOr<Ends> OpenRequest() {
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) {
    return SystemError("cannot make a pair of sockets");
  }
  return Ends{Descriptor(ends[0]), Descriptor(ends[1])};
}

absl::StatusOr<Ends> OpenAnswer() {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) return SystemError("cannot create a pipe");
  return Ends{Descriptor(ends[1]), Descriptor(ends[0])};
}

absl::StatusOr<Ends> OpenFile(const std::string& path, bool is_input) {
  const int flags = is_input ? O_RDONLY : O_WRONLY | O_CREAT | O_TRUNC | O_APPEND;
  Ends ends{Descriptor(open(path.c_str(), flags | O_CLOEXEC, 0666)), {}};
  if (ends.child.number() < 0) return SystemError(absl::StrCat("cannot open ", path));
  return ends;
}

absl::StatusOr<Ends> Open(const ChildStream& stream, bool is_input) {
  switch (stream.kind) {
    case ChildStream::Kind::kPipe:
      return is_input ? OpenRequest() : OpenAnswer();
    case ChildStream::Kind::kFile:
      return OpenFile(stream.path, is_input);
    case ChildStream::Kind::kNull:
      return OpenFile("/dev/null", is_input);
    default:
      return Ends{};
  }
}

// Pointers to the words, and the null that ends them.
std::vector<char*> Pointers(std::vector<std::string>& words) {
  std::vector<char*> pointers;
  pointers.reserve(words.size() + 1);
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  return pointers;
}

std::vector<std::string> Environment(const std::vector<std::string>& additions) {
  std::vector<std::string> all = additions;
  const auto is_replaced = [&additions](absl::string_view entry) {
    const absl::string_view name = entry.substr(0, entry.find('=') + 1);
    return std::any_of(additions.begin(), additions.end(), [name](const std::string& addition) {
      return absl::StartsWith(addition, name);
    });
  };
  for (char** entry = environ; *entry != nullptr; ++entry) {
    if (!is_replaced(*entry)) all.emplace_back(*entry);
  }
  return all;
}

class SpawnActions {
 public:
  SpawnActions() { posix_spawn_file_actions_init(&actions_); }
  ~SpawnActions() { posix_spawn_file_actions_destroy(&actions_); }
  SpawnActions(const SpawnActions&) = delete;
  SpawnActions& operator=(const SpawnActions&) = delete;

  void Join(const Ends& ends, int stream) {
    if (ends.child.number() < 0) return;
    posix_spawn_file_actions_adddup2(&actions_, ends.child.number(), stream);
  }
  void WorkIn(const std::string& folder) {
    if (!folder.empty()) posix_spawn_file_actions_addchdir_np(&actions_, folder.c_str());
  }
  // Last: what other threads have opened without O_CLOEXEC would else live on in the child, and
  // keep ends of other children's pipes open.
  void CloseOthers() { posix_spawn_file_actions_addclosefrom_np(&actions_, kFirstOther); }

  const posix_spawn_file_actions_t* get() const { return &actions_; }

 private:
  posix_spawn_file_actions_t actions_{};
};

class SpawnAttributes {
 public:
  explicit SpawnAttributes(bool own_group) {
    posix_spawnattr_init(&attributes_);
    sigset_t none;
    sigemptyset(&none);
    posix_spawnattr_setsigmask(&attributes_, &none);
    sigset_t defaults;
    sigfillset(&defaults);
    // A shell that starts a program in the background, and nohup, have these ignored for good.
    for (const int kept : {SIGHUP, SIGINT, SIGQUIT, SIGTERM}) sigdelset(&defaults, kept);
    posix_spawnattr_setsigdefault(&attributes_, &defaults);
    int flags = POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF;
    if (own_group) flags |= POSIX_SPAWN_SETPGROUP;
    posix_spawnattr_setflags(&attributes_, static_cast<int16_t>(flags));
  }
  ~SpawnAttributes() { posix_spawnattr_destroy(&attributes_); }
  SpawnAttributes(const SpawnAttributes&) = delete;
  SpawnAttributes& operator=(const SpawnAttributes&) = delete;

  const posix_spawnattr_t* get() const { return &attributes_; }

 private:
  posix_spawnattr_t attributes_{};
};

}  // namespace

absl::StatusOr<std::unique_ptr<ChildProcess>> ChildProcess::Start(const ChildOptions& options) {
  TF_ASSIGN_OR_RETURN(Ends input, Open(options.input, /*is_input=*/true));
  TF_ASSIGN_OR_RETURN(Ends output, Open(options.output, /*is_input=*/false));
  TF_ASSIGN_OR_RETURN(Ends errors, Open(options.errors, /*is_input=*/false));
  SpawnActions actions;
  actions.Join(input, STDIN_FILENO);
  actions.Join(output, STDOUT_FILENO);
  actions.Join(errors, STDERR_FILENO);
  actions.WorkIn(options.folder);
  actions.CloseOthers();
  const SpawnAttributes attributes(options.own_group);
  std::vector<std::string> words = {options.program};
  words.insert(words.end(), options.arguments.begin(), options.arguments.end());
  std::vector<std::string> environment = Environment(options.environment);
  pid_t pid = -1;
  const int error = posix_spawn(&pid, options.program.c_str(), actions.get(), attributes.get(),
                                Pointers(words).data(), Pointers(environment).data());
  if (error != 0) {
    return absl::ErrnoToStatus(error, absl::StrCat("cannot start ", options.program));
  }
  return std::unique_ptr<ChildProcess>(
      new ChildProcess(pid, options.own_group, input.ours.Release(), output.ours.Release()));
}

ChildProcess::~ChildProcess() {
  const bool runs = !WaitFor(std::chrono::milliseconds(0)).has_value();
  if (runs && own_group_) SignalGroup(SIGKILL);
  if (runs) Signal(SIGKILL);
  Wait();
  CloseRequest();
  if (answer_ >= 0) close(answer_);
}

void ChildProcess::CloseRequest() {
  if (request_ >= 0) close(std::exchange(request_, -1));
}

ChildEnd ChildProcess::Wait() { return *WaitFor(std::chrono::milliseconds::max()); }

// WNOWAIT leaves the ended child as it is, so that its number stays its own until Reap has taken
// the lock: Signal can never reach another process that has got the number since then.
std::optional<ChildEnd> ChildProcess::WaitFor(std::chrono::milliseconds time) {
  const bool for_ever = time == std::chrono::milliseconds::max();
  const auto start = std::chrono::steady_clock::now();
  for (;;) {
    siginfo_t info{};
    const int result =
        waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOWAIT | (for_ever ? 0 : WNOHANG));
    if (result != 0 && errno == EINTR) continue;
    if (result != 0 || info.si_pid != 0) return Reap();
    if (std::chrono::steady_clock::now() - start >= time) return std::nullopt;
    std::this_thread::sleep_for(kPollInterval);
  }
}

// Where SIGCHLD is ignored the system reaps the child, and how it ended remains unknown.
ChildEnd ChildProcess::Reap() {
  const MutexLock lock(mutex_);
  if (end_) return *end_;
  int status = 0;
  pid_t reaped = -1;
  do {
    reaped = waitpid(pid_, &status, 0);
  } while (reaped < 0 && errno == EINTR);
  end_ = ChildEnd{};
  if (reaped == pid_ && WIFEXITED(status)) end_->exit_code = WEXITSTATUS(status);
  if (reaped == pid_ && WIFSIGNALED(status)) end_->signal = WTERMSIG(status);
  return *end_;
}

void ChildProcess::Signal(int signal) {
  const MutexLock lock(mutex_);
  if (!end_) kill(pid_, signal);
}

void ChildProcess::SignalGroup(int signal) { kill(-pid_, signal); }

std::string ProgramFolder() {
  std::error_code error;
  return fs::read_symlink("/proc/self/exe", error).parent_path().string();
}

absl::StatusOr<std::string> FindProgram(absl::string_view name) {
  const fs::path folder = ProgramFolder();
  const std::string beside = (folder / std::string(name)).string();
  const fs::path installed = folder.parent_path() / "libexec/tissueform" / std::string(name);
  for (const std::string& path : {beside, installed.string()}) {
    if (access(path.c_str(), X_OK) == 0) return path;
  }
  return absl::NotFoundError(absl::StrCat("no program ", beside, "; build it (target ", name,
                                          ") or install it beside ", folder.string(), " or in ",
                                          installed.parent_path().string()));
}

}  // namespace tissueform
