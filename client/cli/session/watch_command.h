// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "CLI/CLI.hpp"

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `tissueform watch`: follows a session that a user drags, a line a second.
void AddWatchCommand(CLI::App& app, CommandWork* work);

}  // namespace tissueform
