// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>

#include "absl/status/statusor.h"

#include "core/base/process/child_process.h"

namespace tissueform {

// What a program, and each that it starts, may use; 0: as much as this process.
struct ProgramLimits {
  int64_t max_memory_bytes = 0;  // of addresses; not under sanitizers, which reserve terabytes
  int max_seconds = 0;           // of processor time: then SIGKILL
  int64_t max_file_bytes = 0;    // of every file that it writes: beyond, writing fails
};

// A program that is not one of our helpers (an X server, a solver, a server of ours) and so does
// not watch a pipe: it runs under tissueform-guard, which ends it and what it has started when this
// object or this process ends, for any reason. Ending means SIGTERM, and SIGKILL when the program
// is still there after the grace period; processes that it leaves behind are killed.
//
// Its exit code comes through: 128 + signal when one has ended it.
class GuardedProgram {
 public:
  // `options.program` is a path, or a name that is looked up in PATH; `options.input` and
  // `options.own_group` do not count: it reads nothing, and is of a group of its own.
  //
  // Errors: NotFound (no such program), those of ChildProcess::Start and FindProgram.
  static absl::StatusOr<std::unique_ptr<GuardedProgram>> Start(ChildOptions options,
                                                               std::chrono::milliseconds grace,
                                                               const ProgramLimits& limits = {});
  // Ends it, and waits until it has ended.
  ~GuardedProgram();
  GuardedProgram(const GuardedProgram&) = delete;
  GuardedProgram& operator=(const GuardedProgram&) = delete;

  // Our end of a piped output, or -1.
  int answer() const { return guard_->answer(); }

  // Begins to end it; returns at once.
  void Terminate() { guard_->CloseRequest(); }

  // Waits until it has ended.
  ChildEnd Wait() { return guard_->Wait(); }
  // Nothing when it still runs after that time.
  std::optional<ChildEnd> WaitFor(std::chrono::milliseconds time) { return guard_->WaitFor(time); }

 private:
  explicit GuardedProgram(std::unique_ptr<ChildProcess> guard) : guard_(std::move(guard)) {}

  const std::unique_ptr<ChildProcess> guard_;
};

}  // namespace tissueform
