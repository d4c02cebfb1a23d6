// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `tissueform export`: a plan as one HTML file in which its bone can be moved and the face follows,
// without any server (docs/moving-file.md).
void AddExportCommand(CLI::App& app, CommandWork* work);

}  // namespace tissueform
