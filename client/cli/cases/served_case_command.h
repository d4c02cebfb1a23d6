// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `tissueform case publish|list|show|delete`: the cases of a server. Adds them to `tissueform
// case`.
void AddServedCaseCommands(CLI::App& command, CommandWork* work);

}  // namespace tissueform
