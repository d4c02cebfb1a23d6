// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/shared/command_line.h"

#include <iostream>
#include <string>

#include "client/cli/shared/exit_code.h"
#include "client/cli/shared/option_checks.h"
#include "client/cli/shared/version.h"

namespace tissueform {
namespace {

constexpr char kDescription[] =
    "Predicts soft tissue after jaw surgery from a plan: a tet mesh, fixed vertices, handles and "
    "how.\n"
    "Research software, not a medical device: not for diagnosis or treatment.";

constexpr char kFooter[] =
    "Getting started:\n"
    "  tissueform mesh check face.vtu\n"
    "  tissueform plan check plan.json\n"
    "  tissueform deform plan.json --out after.vtu\n\n"
    "Exit codes: 0 done, 1 the work failed, 2 wrong use. Errors are one line on stderr.\n"
    "Plan files: docs/plan-format.md.";

}  // namespace

int RunCommandLine(int argc, char** argv,
                   const std::function<void(CLI::App& app, CommandWork* work)>& add_commands) {
  CLI::App app(kDescription, "tissueform");
  app.footer(kFooter);
  app.set_version_flag("--version", std::string("tissueform ") + kVersion);
  // One: after it a command's name is a word like others (`prediction compare` is not `compare`).
  app.require_subcommand(0, 1);
  CommandWork work;
  add_commands(app, &work);
  RefuseNonFinite(&app);
  try {
    app.parse(argc, argv);
    if (!work) throw CLI::RequiredError::Subcommand(1);
  } catch (const CLI::ParseError& error) {
    return ReportParseError(app, error, std::cout, std::cerr);
  }
  absl::Status outcome = work();
  outcome.Update(FlushOutput());
  return ReportOutcome(outcome, std::cerr);
}

}  // namespace tissueform
