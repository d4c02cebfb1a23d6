// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `plan build --server HOST:PORT`, below a command `plan` of its own.
void AddServerBuildCommand(CLI::App& app, CommandWork* work);

}  // namespace tissueform
