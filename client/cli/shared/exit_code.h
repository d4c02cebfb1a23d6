// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <ostream>

#include "CLI/CLI.hpp"
#include "absl/status/status.h"

namespace tissueform {

// Exit codes of every command.
enum ExitCode : int {
  kExitDone = 0,
  kExitWorkFailed = 1,
  kExitWrongUse = 2,
};

// The exit code for the outcome of a command. An error is written to `err` as exactly one line that
// starts with "tissueform: ": line breaks and other control characters inside a message become
// spaces.
ExitCode ReportOutcome(const absl::Status& outcome, std::ostream& err);

// DataLoss when what was printed did not arrive, as on a full disk.
absl::Status FlushOutput();

// The same for what CLI11 throws: help and version go to `out` and are done, everything else is
// wrong use.
ExitCode ReportParseError(const CLI::App& app, const CLI::ParseError& error, std::ostream& out,
                          std::ostream& err);

}  // namespace tissueform
