// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

#include "core/base/process/guarded_program.h"

namespace tissueform {

// Of a command that packs or draws one case, beyond which it is damaged or attacked: the bundled
// head takes 1 GiB and half a minute.
inline constexpr ProgramLimits kCommandLimits = {
    .max_memory_bytes = int64_t{16} << 30, .max_seconds = 1800, .max_file_bytes = int64_t{4} << 30};

// Runs the program `tissueform` that lies beside this one, under the guard: it ends with this
// process, after `most_time` or beyond its limits at the latest, and soon after the descriptor
// `cancel` (-1: none) has become readable. What it prints goes to the file `log`.
//
// Errors: NotFound: no such program; FailedPrecondition with `what` and the last line that it has
// printed, but ResourceExhausted (DISK_FULL) where the log's disk has no room; DeadlineExceeded;
// Cancelled.
absl::Status RunTissueform(const std::vector<std::string>& arguments, absl::string_view what,
                           const std::string& log, std::chrono::seconds most_time, int cancel,
                           const ProgramLimits& limits = kCommandLimits);

// Whether there is room for a file on the disk of a folder. True where it cannot be asked.
bool HasRoom(const std::string& folder);

}  // namespace tissueform
