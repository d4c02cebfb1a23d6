// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `plan check PLAN.json`: reads a plan, puts it upon its mesh and says what it asks for. Returns
// the command `plan`, for what else is done with plans.
CLI::App* AddPlanCommand(CLI::App& app, CommandWork* work);

}  // namespace tissueform
