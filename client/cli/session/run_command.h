// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `run PLAN --server HOST:PORT --out OUT.vtu [--stats STATS.json]`: what `deform` does, through a
// server. The same numbers up to the float32 in which the server answers.
void AddRunCommand(CLI::App& app, CommandWork* work);

}  // namespace tissueform
