// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `load [--server HOST:PORT] [--sessions N] [--rate N] [--seconds N] [--churn N] ...`: many drags
// at once, and how old their pictures were.
void AddLoadCommand(CLI::App& app, CommandWork* work);

}  // namespace tissueform
