// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "CLI/CLI.hpp"

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `tissueform plan fit`: which poses of the bone give the face that is wanted. `app` is `plan`.
void AddPlanFitCommand(CLI::App& app, CommandWork* work);

}  // namespace tissueform
