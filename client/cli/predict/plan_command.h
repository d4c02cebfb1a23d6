// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "client/cli/shared/command.h"

namespace tissueform {

// `plan check PLAN.json`: reads a plan, puts it upon its mesh and says what it asks for; and
// `plan build`, which a companion does with the words of this process's command line.
void AddPlanCommand(CLI::App& app, const std::vector<std::string>& words, CommandWork* work);

}  // namespace tissueform
