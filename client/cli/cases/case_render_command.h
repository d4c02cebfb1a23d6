// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `tissueform case render`: the pictures of `prediction export --png` without a server.
void AddCaseRenderCommand(CLI::App& command, CommandWork* work);

}  // namespace tissueform
