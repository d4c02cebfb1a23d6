// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/command.h"

namespace tissueform {

// `compare A B [--by POINT_DATA] [--out DIFF.vtu] [--json]`: distances between corresponding
// vertices.
void AddCompareCommand(CLI::App& app, CommandWork* work);

}  // namespace tissueform
