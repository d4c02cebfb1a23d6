// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `compare A B [--by POINT_DATA] [--out DIFF.vtu] [--csv FILE] [--json]`: distances between
// corresponding vertices of two results.
//
// `compare PLAN.json [--models M,M] [--reference M] [--out DIR] [--csv FILE] [--json]`: the same
// between the answers of several models to one plan.
void AddCompareCommand(CLI::App& app, CommandWork* work);

}  // namespace tissueform
