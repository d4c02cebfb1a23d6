// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `tissueform login`: asks an identity provider for a token, which the other commands then send.
void AddLoginCommand(CLI::App& app, CommandWork* work);

// `tissueform logout`: removes it.
void AddLogoutCommand(CLI::App& app, CommandWork* work);

}  // namespace tissueform
