// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/server_build/server_build_command.h"

#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"

#include "client/cli/plan_build/ending_signals.h"
#include "client/cli/plan_build/plan_build_inputs.h"
#include "client/cli/server_build/server_build.h"
#include "client/cli/session/server_connection.h"
#include "core/base/atomic_folder.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

struct ServerBuildArguments {
  PlanBuildInputs inputs;
  ServerConnection server;
  std::string title;
};

// The server calls the folder of a plan "plan"; here it has the user's name.
std::string SummaryOf(const ServerBuildResult& built, const std::string& folder) {
  return absl::StrReplaceAll(built.build.summary(),
                             {{" plan/", absl::StrCat(" ", folder, "/")},
                              {"the plan in plan ", absl::StrCat("the plan in ", folder, " ")}});
}

absl::Status RunServerBuild(const ServerBuildArguments& arguments) {
  TF_RETURN_IF_ERROR(CheckFillable(arguments.inputs.out));
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(arguments.server));
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<EndingSignals> signals, EndingSignals::Catch());
  const absl::StatusOr<ServerBuildResult> built =
      BuildOnServer(&client->plan_builds(), arguments.inputs, arguments.title, *signals);
  if (signals->arrived()) signals->EndByArrived();
  TF_RETURN_IF_ERROR(built.status());
  absl::PrintF("%s%scase    %s\n", built->notes, SummaryOf(*built, arguments.inputs.out),
               built->build.case_());
  return CheckReady(arguments.inputs, built->build.is_ready(), built->build.defects());
}

constexpr char kFooter[] =
    "Builds on a server what `tissueform plan build` builds here, with the same result. The CT is "
    "read on this machine, and only its geometry and values are sent, without anything from its "
    "headers; of a label map also the names of its segments. Recipe, surfaces, transforms and "
    "markups are sent as they are: they must not name the patient.\n\n"
    "DIR gets the files of the plan, all or nothing; Ctrl-C also ends the build on the server. "
    "The server keeps the case, which the last line names, and deletes the volumes.\n\n"
    "Example:\n"
    "  tissueform plan build --server localhost:50051 --ct series/ --recipe recipe.json --out "
    "head\n"
    "Exit codes: 0 done, 1 the work failed or the plan is not ready, 2 wrong use, 128 + signal "
    "when ended by one.";

}  // namespace

void AddServerBuildCommand(CLI::App& app, CommandWork* work) {
  auto arguments = std::make_shared<ServerBuildArguments>();
  CLI::App* plan = app.add_subcommand("plan", "work on plan files");
  plan->group("")->require_subcommand(1);
  CLI::App* build = plan->add_subcommand("build", "build a plan on a server");
  AddServerOption(build, &arguments->server);
  AddPlanBuildInputs(build, &arguments->inputs);
  build->add_option("--title", arguments->title,
                    "title of the case on the server (default: the segments)");
  build->footer(kFooter);
  build->callback(
      [arguments, work] { *work = [arguments] { return RunServerBuild(*arguments); }; });
}

}  // namespace tissueform
