// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <iostream>

#include "client/cli/bench_command.h"
#include "client/cli/command.h"
#include "client/cli/compare_command.h"
#include "client/cli/deform_command.h"
#include "client/cli/demo_command.h"
#include "client/cli/exit_code.h"
#include "client/cli/experiments_command.h"
#include "client/cli/mesh_command.h"
#include "client/cli/plan_command.h"
#include "client/cli/run_command.h"
#include "client/cli/version.h"

namespace {

constexpr char kDescription[] =
    "Predicts soft tissue after jaw surgery from a plan: a tet mesh, what is fixed, what moves and "
    "how.\n"
    "Research software, not a medical device: not for diagnosis or treatment.";

constexpr char kFooter[] =
    "A first run:\n"
    "  tissueform mesh check face.vtu\n"
    "  tissueform plan check plan.json\n"
    "  tissueform deform plan.json --out after.vtu\n\n"
    "Exit codes: 0 done, 1 the work failed, 2 wrong use. Errors are one line on stderr.\n"
    "The plan file is described in docs/plan-format.md.";

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(kDescription, "tissueform");
  app.footer(kFooter);
  app.set_version_flag("--version", std::string("tissueform ") + tissueform::kVersion);

  tissueform::CommandWork work;
  tissueform::AddMeshCommand(app, &work);
  tissueform::AddPlanCommand(app, &work);
  tissueform::AddDeformCommand(app, &work);
  tissueform::AddRunCommand(app, &work);
  tissueform::AddCompareCommand(app, &work);
  tissueform::AddExperimentsCommand(app, &work);
  tissueform::AddBenchCommand(app, &work);
  tissueform::AddDemoCommand(app, &work);
  try {
    app.parse(argc, argv);
    if (!work) throw CLI::RequiredError::Subcommand(1);
  } catch (const CLI::ParseError& error) {
    return tissueform::ReportParseError(app, error, std::cout, std::cerr);
  }
  absl::Status outcome = work();
  outcome.Update(tissueform::FlushOutput());
  return tissueform::ReportOutcome(outcome, std::cerr);
}
