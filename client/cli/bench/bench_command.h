// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command.h"

namespace tissueform {

// `bench [--mesh N] [--repetitions N] [--threads N] [--json OUT.json]`: becomes the program
// tissueform-benchmarks, which lies beside this one, so that its output, its exit code and Ctrl-C
// are the command's own.
void AddBenchCommand(CLI::App& app, CommandWork* work);

}  // namespace tissueform
