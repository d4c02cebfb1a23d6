// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `tissueform audit keygen` and `tissueform audit verify`: the audit log of a server, without one.
void AddAuditCommand(CLI::App& app, CommandWork* work);

}  // namespace tissueform
