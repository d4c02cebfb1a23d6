// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

#include "core/base/process/pipe_stream.h"

namespace tissueform {

// What a helper program may use before it is stopped.
struct IsolationLimits {
  int64_t max_memory_bytes = int64_t{16} << 30;  // beyond what it has when it begins
  int max_seconds = 600;                         // of processor time
  int64_t max_file_bytes = 0;                    // of every file that it writes
};

// Both sides of a call must be of one build: the layout of what is sent is no public format.
inline constexpr int64_t kHelperCallVersion = 0x5446'0001;

// Inside a helper program: main() returns this.
//
// Libraries that read files or mesh surfaces crash, loop, print and end the program on damaged
// input, and some know one state for the whole process. They live in helper programs, one call a
// process, started by CallHelper (core/base/process/helper_call.h), which says how a call goes.
//
// Takes the limits from stdin and sets them on this process, so that the process that started it
// needs no limits itself; discards what is printed; ends this process at once when the other end of
// stdin closes, because the caller has died or no longer wants the answer. Then calls `work`, which
// reads its request to the end before it sends anything, and begins its answer with
// PipeSender::Outcome. Leaves by _exit: libraries are not taken down.
int RunHelperProgram(const std::function<void(const IsolationLimits& limits, PipeReceiver* request,
                                              PipeSender* answer)>& work);

// Calls `work` without letting an exception out: InvalidArgument where a library gave up (`what`
// says what was tried, "reading it"), ResourceExhausted where there was no memory.
absl::Status WithoutExceptions(absl::string_view what, const IsolationLimits& limits,
                               const std::function<absl::Status()>& work);

// The parts of RunHelperProgram, for programs that live differently.

// Starts a thread that ends this process, with SIGKILL's exit code and without any cleanup, when no
// process holds the other end of the socket or pipe. Not PR_SET_PDEATHSIG, which fires when the
// *thread* ends that started this process. The descriptor stays open and is not read.
void EndWhenClosed(int descriptor);

// From now on this process may use so much and leaves no core file. Memory
// is not limited under sanitizers, which reserve terabytes of addresses for themselves.
void BindToLimits(const IsolationLimits& limits);

}  // namespace tissueform
