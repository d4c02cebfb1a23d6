// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `tissueform server-info`: what a server is and what it takes.
void AddServerInfoCommand(CLI::App& app, CommandWork* work);

}  // namespace tissueform
