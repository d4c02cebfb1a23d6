// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <string>
#include <vector>

#include "client/cli/bench_command.h"
#include "client/cli/command_line.h"
#include "client/cli/companion.h"
#include "client/cli/compare_command.h"
#include "client/cli/deform_command.h"
#include "client/cli/mesh_command.h"
#include "client/cli/plan_command.h"

int main(int argc, char** argv) {
  const std::vector<std::string> words(argv + 1, argv + argc);
  return tissueform::RunCommandLine(argc, argv, [&](CLI::App& app, tissueform::CommandWork* work) {
    tissueform::AddMeshCommand(app, work);
    tissueform::AddPlanCommand(app, words, work);
    tissueform::AddDeformCommand(app, work);
    tissueform::AddCompanionCommand(app, tissueform::kRunCommand, words, work);
    tissueform::AddCompareCommand(app, work);
    tissueform::AddCompanionCommand(app, tissueform::kExperimentsCommand, words, work);
    tissueform::AddBenchCommand(app, work);
    tissueform::AddCompanionCommand(app, tissueform::kDemoCommand, words, work);
  });
}
