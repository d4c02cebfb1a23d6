// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// tissueform-guard GRACE_MS MEMORY_BYTES SECONDS FILE_BYTES PROGRAM [ARGUMENT]...
//
// Runs a program that is not ours, and so cannot watch a pipe itself, until it ends or standard
// input does (guarded_program.h starts it). It has one thread and no library that could start one:
// fork is harmless here, and PR_SET_PDEATHSIG means what one would think, because the thread that
// forks ends with the process.

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <initializer_list>
#include <poll.h>
#include <unistd.h>

#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/signalfd.h>
#include <sys/wait.h>

namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kLimitsMemory = false;
#else
constexpr bool kLimitsMemory = true;
#endif

constexpr int kFirstWord = 5;  // of the program, among ours
constexpr long long kMaxGraceMs = 3600 * 1000;
constexpr int kWrongUse = 2;
constexpr int kCannotStart = 126;
constexpr int kNoSuchProgram = 127;

// -1 if the word is not a number.
long long NumberOf(const char* word) {
  char* end = nullptr;
  const long long number = std::strtoll(word, &end, 10);
  return end == word || *end != '\0' ? -1 : number;
}

void ReplaceByNothing(int descriptor, int flags) {
  const int nothing = open("/dev/null", flags | O_CLOEXEC);
  dup2(nothing, descriptor);
  close(nothing);
}

// What the program may use; 0: no limit.
struct Limits {
  long long memory_bytes;
  long long seconds;
  long long file_bytes;
};

void SetLimit(int resource, long long value) {
  if (value == 0) return;
  const rlimit limit{static_cast<rlim_t>(value), static_cast<rlim_t>(value)};
  setrlimit(static_cast<__rlimit_resource>(resource), &limit);
}

void Bind(const Limits& limits) {
  if (kLimitsMemory) SetLimit(RLIMIT_AS, limits.memory_bytes);
  SetLimit(RLIMIT_CPU, limits.seconds);
  SetLimit(RLIMIT_FSIZE, limits.file_bytes);
  // So that writing fails, as on a full disk.
  if (limits.file_bytes != 0) std::signal(SIGXFSZ, SIG_IGN);
}

// In the child, between fork and exec.
[[noreturn]] void Become(char** words, pid_t guard, const sigset_t& former, const Limits& limits) {
  setpgid(0, 0);
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != guard) _exit(kCannotStart);  // which ended before prctl
  ReplaceByNothing(STDIN_FILENO, O_RDONLY);
  sigprocmask(SIG_SETMASK, &former, nullptr);
  Bind(limits);
  execvp(words[0], words);
  const int error = errno;
  std::fprintf(stderr, "tissueform-guard: cannot start %s: %s\n", words[0], std::strerror(error));
  _exit(error == ENOENT ? kNoSuchProgram : kCannotStart);
}

// The exit code as a shell reports it; -1 while the program runs. Processes that the program leaves
// behind are killed before it is reaped, since until then no other process can get its number. They
// get no SIGTERM: a shell's child that gets one before its exec may lose it with the shell's
// handlers.
int ExitCodeOf(pid_t program) {
  siginfo_t info{};
  if (waitid(P_PID, program, &info, WEXITED | WNOWAIT | WNOHANG) != 0 || info.si_pid == 0) {
    return -1;
  }
  kill(-program, SIGKILL);
  int status = 0;
  waitpid(program, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

bool HasEnded(int input) {
  char ignored[64];
  const ssize_t count = read(input, ignored, sizeof(ignored));
  return count == 0 || (count < 0 && errno != EINTR && errno != EAGAIN);
}

// Waits for the end of the program, and passes on to its group what asks for it: the end of
// standard input, or a signal.
int Watch(pid_t program, int signals, int grace_ms) {
  pollfd watched[] = {{signals, POLLIN, 0}, {STDIN_FILENO, POLLIN, 0}};
  bool asked = false;
  for (;;) {
    if (poll(watched, asked ? 1 : 2, asked ? grace_ms : -1) == 0) kill(-program, SIGKILL);
    signalfd_siginfo arrived{};
    bool ask = false;
    if (watched[0].revents != 0 && read(signals, &arrived, sizeof(arrived)) > 0) {
      const int code = ExitCodeOf(program);
      if (code >= 0) return code;
      ask = arrived.ssi_signo != SIGCHLD;
    }
    if (!asked && watched[1].revents != 0 && HasEnded(STDIN_FILENO)) ask = true;
    if (ask) {
      asked = true;
      kill(-program, SIGTERM);
    }
    watched[0].revents = watched[1].revents = 0;
  }
}

}  // namespace

int main(int argc, char** argv) {
  const bool enough = argc > kFirstWord;
  const long long grace_ms = enough ? NumberOf(argv[1]) : -1;
  const Limits limits = {enough ? NumberOf(argv[2]) : -1, enough ? NumberOf(argv[3]) : -1,
                         enough ? NumberOf(argv[4]) : -1};
  if (grace_ms < 0 || grace_ms > kMaxGraceMs || limits.memory_bytes < 0 || limits.seconds < 0 ||
      limits.file_bytes < 0) {
    std::fprintf(stderr,
                 "use: tissueform-guard GRACE_MS MEMORY_BYTES SECONDS FILE_BYTES PROGRAM "
                 "[ARGUMENT]...\n");
    return kWrongUse;
  }
  sigset_t signals;
  sigset_t former;
  sigemptyset(&signals);
  for (const int number : {SIGCHLD, SIGTERM, SIGINT, SIGHUP}) sigaddset(&signals, number);
  sigprocmask(SIG_BLOCK, &signals, &former);
  const int arriving = signalfd(-1, &signals, SFD_CLOEXEC);
  const pid_t guard = getpid();
  const pid_t program = fork();
  if (program < 0 || arriving < 0) {
    std::perror("tissueform-guard");
    return kCannotStart;
  }
  if (program == 0) Become(argv + kFirstWord, guard, former, limits);
  setpgid(program, program);                  // both processes call it; either may be first
  ReplaceByNothing(STDOUT_FILENO, O_WRONLY);  // whose end is the program's alone
  return Watch(program, arriving, static_cast<int>(grace_ms));
}
