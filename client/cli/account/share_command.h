// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `tissueform share add|list|remove`: who may do what with one's own on a server.
void AddShareCommand(CLI::App& app, CommandWork* work);

}  // namespace tissueform
