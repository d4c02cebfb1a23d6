// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

#include "core/process/helper_program.h"

namespace tissueform {

// Runs `work` in a child process of its own: libraries that read files or mesh surfaces crash,
// loop, print and end the program on damaged input, and some know one state for the whole process.
// The child is bound to the limits, cannot write files, and what it prints is lost. It hands its
// result over through the pipe: `work` writes into the descriptor that it is given and says whether
// all of it went through (false when the reader has gone away); `receive` reads from the other end,
// in this process.
//
// Errors: those of `receive`. Where `receive` says DataLoss, because the child ended in the middle:
// InvalidArgument when it crashed, ResourceExhausted when a limit stopped it. Internal when there
// can be no child. `what` says what was tried ("reading it").
//
// REQUIRES: `work` needs no other thread of this process and no lock that one may hold.
absl::Status RunIsolated(absl::string_view what, const IsolationLimits& limits,
                         const std::function<bool(int descriptor)>& work,
                         const std::function<absl::Status(int descriptor)>& receive);

}  // namespace tissueform
