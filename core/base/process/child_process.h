// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include <sys/types.h>

#include "core/base/mutex.h"

namespace tissueform {

// What one of a child's standard streams is joined to.
struct ChildStream {
  enum class Kind { kInherited, kNull, kPipe, kFile };

  static ChildStream Inherited() { return {}; }
  static ChildStream Null() { return {Kind::kNull, {}}; }
  // To this process; not for stderr.
  static ChildStream Pipe() { return {Kind::kPipe, {}}; }
  // Read where it is the input, otherwise written from its beginning; output and errors may name
  // the same file.
  static ChildStream File(std::string path) { return {Kind::kFile, std::move(path)}; }

  Kind kind = Kind::kInherited;
  std::string path;
};

struct ChildOptions {
  std::string program;                   // its path, with a slash: PATH is not searched
  std::vector<std::string> arguments;    // after the name
  std::vector<std::string> environment;  // "NAME=value", instead of or beside this process's
  std::string folder;                    // to work in; empty: that of this process

  ChildStream input = ChildStream::Null();
  ChildStream output = ChildStream::Null();
  ChildStream errors;

  // Ctrl-C in the terminal then reaches this process only, and SignalGroup reaches the child with
  // all that it has started.
  bool own_group = false;
};

// How a child ended: by itself with an exit code, or by a signal.
struct ChildEnd {
  int exit_code = -1;  // -1 when a signal ended it, or when the system kept no account of it
  int signal = 0;      // 0 when it ended by itself
};

// A program that runs as a child of this process. The child has the three standard streams and no
// other descriptor of ours, no blocked signal, and the default for those that we ignore, except
// those with which a terminal or a shell ends programs (SIGHUP, SIGINT, SIGQUIT, SIGTERM).
//
// Created with posix_spawn: any thread may start children, independently of the others, and the
// child does not end when the thread that started it ends.
//
// Threads: Signal may be called while another thread waits; otherwise one thread at a time.
class ChildProcess {
 public:
  // Errors: NotFound when there is no such program, or what the system says.
  static absl::StatusOr<std::unique_ptr<ChildProcess>> Start(const ChildOptions& options);

  // Ends it (SIGKILL, its group where it has one of its own) unless it has ended, and reaps it.
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  pid_t pid() const { return pid_; }

  // Our end of a piped input, a socket: write with PipeSender, which fails and does not raise
  // SIGPIPE when the child has gone. -1 without one. The child sees the end of its input when the
  // last copy is closed, also when this process dies.
  int request() const { return request_; }
  void CloseRequest();
  // Our end of a piped output, or -1.
  int answer() const { return answer_; }

  // Waits until it has ended.
  ChildEnd Wait();
  // Nothing when it still runs after that time.
  std::optional<ChildEnd> WaitFor(std::chrono::milliseconds time);

  // Sends a signal to the child; nothing happens when it has ended.
  void Signal(int signal);
  // To its group, of which some may be left when the child has just ended. REQUIRES: own_group.
  void SignalGroup(int signal);

 private:
  ChildProcess(pid_t pid, bool own_group, int request, int answer)
      : pid_(pid), own_group_(own_group), request_(request), answer_(answer) {}

  ChildEnd Reap();

  const pid_t pid_;
  const bool own_group_;
  int request_;
  const int answer_;

  Mutex mutex_;
  std::optional<ChildEnd> end_ ABSL_GUARDED_BY(mutex_);  // when it has been reaped
};

// The folder in which the running program lies.
std::string ProgramFolder();

// The path of a program of this product: in the folder of the running program, or in
// ../libexec/tissueform relative to it, where programs are installed that users do not run.
//
// Errors: NotFound, with what to do.
absl::StatusOr<std::string> FindProgram(absl::string_view name);

}  // namespace tissueform
