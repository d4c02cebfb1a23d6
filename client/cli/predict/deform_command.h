// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `deform PLAN --out OUT.vtu [--model M] [--stats STATS.json]`: predicts in this process, without a
// server.
void AddDeformCommand(CLI::App& app, CommandWork* work);

}  // namespace tissueform
