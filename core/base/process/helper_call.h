// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

#include "core/base/process/child_process.h"
#include "core/base/process/helper_program.h"
#include "core/base/process/pipe_stream.h"

namespace tissueform {

// Who does the work, and within what.
struct HelperCall {
  absl::string_view program;  // its name; see FindProgram
  absl::string_view what;     // what it tries, for messages: "reading it"
  IsolationLimits limits;
  // What it means that it ended in the middle; null: see below.
  std::function<absl::Status(const ChildEnd& end)> explain = nullptr;
};

// Lets a helper program do a piece of work: starts it, sends it the limits and what `send` writes,
// and gives its answer to `receive`, whose first word is PipeReceiver::Outcome. Its end is that of
// the call, and the other way round: when this process dies the helper ends too. Any thread may
// call it, many at once.
//
// Errors: those of `receive`. Where `receive` says DataLoss, because the helper ended in the
// middle: InvalidArgument when it crashed, ResourceExhausted when a limit stopped it, or what
// `explain` makes of these; FailedPrecondition when it could not begin. NotFound when there is no
// such program, or what the system says when it cannot be started.
absl::Status CallHelper(const HelperCall& call,
                        const std::function<void(PipeSender* request)>& send,
                        const std::function<absl::Status(int descriptor)>& receive);

}  // namespace tissueform
