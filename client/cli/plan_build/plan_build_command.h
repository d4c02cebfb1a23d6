// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `plan build --ct PATH --recipe RECIPE.json --out DIR`: a planning model from a CT of a head.
void AddPlanBuildCommand(CLI::App& app, CommandWork* work);

}  // namespace tissueform
