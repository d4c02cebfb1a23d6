// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace tissueform {

// Runs the program `tissueform` that lies beside this one, under the guard: it ends with this
// process, after `most_time` at the latest, and soon after the descriptor `cancel` (-1: none) has
// become readable. What it prints goes to the file `log`.
//
// Errors: NotFound: no such program; FailedPrecondition with `what` and the last line that it has
// printed; DeadlineExceeded; Cancelled.
absl::Status RunTissueform(const std::vector<std::string>& arguments, absl::string_view what,
                           const std::string& log, std::chrono::seconds most_time, int cancel);

}  // namespace tissueform
