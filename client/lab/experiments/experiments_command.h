// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `experiments --out DIR [--only NAME]...`: the figures and the table of Liao et al. 2009 as
// pictures and numbers.
void AddExperimentsCommand(CLI::App& app, CommandWork* work);

}  // namespace tissueform
