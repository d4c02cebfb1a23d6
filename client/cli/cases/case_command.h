// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `tissueform case ...`: what the browser planner opens (docs/case-format.md).
void AddCaseCommand(CLI::App& app, CommandWork* work);

}  // namespace tissueform
