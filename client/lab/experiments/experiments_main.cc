// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// The companion of `tissueform` that computes and draws the experiments.

#include "client/cli/shared/command_line.h"
#include "client/lab/experiments/experiments_command.h"

int main(int argc, char** argv) {
  return tissueform::RunCommandLine(argc, argv, [](CLI::App& app, tissueform::CommandWork* work) {
    tissueform::AddExperimentsCommand(app, work);
  });
}
