// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `tissueform whoami`: which identity a server sees.
void AddWhoamiCommand(CLI::App& app, CommandWork* work);

}  // namespace tissueform
