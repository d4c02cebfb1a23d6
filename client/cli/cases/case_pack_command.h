// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `tissueform case pack`: makes a case from a plan. Adds itself to `tissueform case`.
void AddCasePackCommand(CLI::App& command, CommandWork* work);

}  // namespace tissueform
