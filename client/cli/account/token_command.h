// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `tissueform token`: keys and short-lived tokens, for tests and for sites without a provider.
void AddTokenCommand(CLI::App& app, CommandWork* work);

}  // namespace tissueform
