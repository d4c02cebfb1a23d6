// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <string>
#include <vector>

#include "client/cli/account/token_command.h"
#include "client/cli/compare/compare_command.h"
#include "client/cli/mesh/mesh_command.h"
#include "client/cli/plan_build/plan_build_command.h"
#include "client/cli/predict/deform_command.h"
#include "client/cli/predict/plan_command.h"
#include "client/cli/predict/plan_export_command.h"
#include "client/cli/predict/plan_fit_command.h"
#include "client/cli/shared/command_line.h"
#include "client/cli/shared/companion.h"

namespace {

// `plan build` works on this machine, or on the server that it names.
bool NamesServer(const std::vector<std::string>& words) {
  return std::ranges::any_of(words, [](const std::string& word) {
    return word == "--server" || word.starts_with("--server=");
  });
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> words(argv + 1, argv + argc);
  return tissueform::RunCommandLine(argc, argv, [&](CLI::App& app, tissueform::CommandWork* work) {
    CLI::App* mesh = tissueform::AddMeshCommand(app, work);
    for (const auto& command : {tissueform::kMeshUploadCommand, tissueform::kMeshListCommand,
                                tissueform::kMeshDeleteCommand}) {
      tissueform::AddCompanionCommand(*mesh, command, words, work);
    }
    CLI::App* plan = tissueform::AddPlanCommand(app, work);
    if (NamesServer(words)) {
      tissueform::AddCompanionCommand(*plan, tissueform::kServerBuildCommand, words, work);
    } else {
      tissueform::AddPlanBuildCommand(*plan, work);
    }
    tissueform::AddPlanFitCommand(*plan, work);
    tissueform::AddPlanExportCommand(*plan, work);
    tissueform::AddDeformCommand(app, work);
    tissueform::AddCompanionCommand(app, tissueform::kRunCommand, words, work);
    tissueform::AddCompareCommand(app, work);
    tissueform::AddCompanionCommand(app, tissueform::kOutcomeCommand, words, work);
    tissueform::AddCompanionCommand(app, tissueform::kExperimentsCommand, words, work);
    tissueform::AddCompanionCommand(app, tissueform::kBenchCommand, words, work);
    tissueform::AddTokenCommand(app, work);
    tissueform::AddCompanionCommand(app, tissueform::kLoadCommand, words, work);
    tissueform::AddCompanionCommand(app, tissueform::kDragCommand, words, work);
    tissueform::AddCompanionCommand(app, tissueform::kSessionCommand, words, work);
    tissueform::AddCompanionCommand(app, tissueform::kWatchCommand, words, work);
    tissueform::AddCompanionCommand(app, tissueform::kPredictionCommand, words, work);
    tissueform::AddCompanionCommand(app, tissueform::kCaseCommand, words, work);
    tissueform::AddCompanionCommand(app, tissueform::kExportCommand, words, work);
    tissueform::AddCompanionCommand(app, tissueform::kShareCommand, words, work);
    tissueform::AddCompanionCommand(app, tissueform::kWhoamiCommand, words, work);
    tissueform::AddCompanionCommand(app, tissueform::kServerInfoCommand, words, work);
    tissueform::AddCompanionCommand(app, tissueform::kDoctorCommand, words, work);
    tissueform::AddCompanionCommand(app, tissueform::kLoginCommand, words, work);
    tissueform::AddCompanionCommand(app, tissueform::kLogoutCommand, words, work);
    tissueform::AddCompanionCommand(app, tissueform::kDemoCommand, words, work);
  });
}
