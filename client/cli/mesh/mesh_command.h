// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `mesh check MESH [--json]`: validation and quality report; fails when a deformer could not use
// the mesh. `mesh generate`: see mesh_generate_command.h.
// Returns `mesh`, for what others add to it.
CLI::App* AddMeshCommand(CLI::App& app, CommandWork* work);

}  // namespace tissueform
