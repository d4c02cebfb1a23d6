// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `tissueform session link|unlink`: tokens with which others may watch a session. Adds them to
// `tissueform session`.
void AddFollowLinkCommands(CLI::App& session, CommandWork* work);

}  // namespace tissueform
