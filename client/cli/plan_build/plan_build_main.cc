// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// The companion of `tissueform` that makes plans from CTs.

#include "client/cli/plan_build/plan_build_command.h"
#include "client/cli/shared/command_line.h"

int main(int argc, char** argv) {
  return tissueform::RunCommandLine(argc, argv, [](CLI::App& app, tissueform::CommandWork* work) {
    CLI::App* plan = app.add_subcommand("plan", "work on plan files");
    tissueform::AddPlanBuildCommand(*plan, work);
  });
}
