// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `tissueform outcome cohort`: the same for many patients, with statistics. Returns the command.
CLI::App* AddCohortCommand(CLI::App* outcome, CommandWork* work);

}  // namespace tissueform
