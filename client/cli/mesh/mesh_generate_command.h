// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `mesh generate SURFACE --out MESH.vtu [...]`: tets in a closed surface, or the reason why meshing
// failed, with a file to look at. Added to the command `mesh`.
void AddMeshGenerateCommand(CLI::App& mesh, CommandWork* work);

}  // namespace tissueform
