// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `plan export --slicer DIR PLAN`: a plan and its prediction as a scene of 3D Slicer.
void AddPlanExportCommand(CLI::App& app, CommandWork* work);

}  // namespace tissueform
