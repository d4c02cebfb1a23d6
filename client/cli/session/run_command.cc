// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/session/run_command.h"

#include <memory>
#include <string>

#include "client/cli/session/server_connection.h"
#include "client/cli/session/session_wait.h"
#include "client/cli/shared/companion.h"
#include "client/cli/shared/option_checks.h"
#include "client/cli/shared/result_writer.h"
#include "client/cli/shared/stage_progress.h"
#include "client/cli/shared/stats_json.h"
#include "client/cpp/plan_session.h"
#include "client/cpp/tissueform_client.h"
#include "core/base/atomic_file.h"
#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "core/planning/plan_io.h"
#include "proto/conversion/answer_conversion.h"
#include "proto/conversion/contact_conversion.h"

namespace tissueform {
namespace {

struct RunOptions {
  std::string plan;
  PlanReadOptions reading;
  ServerConnection server;
  std::string out;
  std::string stats;
};

// Fills `stats` as far as preparing and solving know it.
absl::StatusOr<Positions> PredictOnServer(const RunOptions& options, const PlanProblem& problem,
                                          PredictionStats* stats) {
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<TissueformClient> client, ConnectTo(options.server));
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<PlanSession> session,
                      MakePlanSession(client.get(), problem, /*stop=*/nullptr));
  const StageProgress progress("solving");
  TF_ASSIGN_OR_RETURN(const v1::DeformOnceResponse answer,
                      client->DeformOnce(session->description().name(), NamedPoses(problem)));
  stats->preparation = ToPreparationSummary(session->description());
  stats->solve = ToSolveSummary(answer.summary());
  if (answer.summary().has_contact()) {
    stats->contact = ToContactSummary(answer.summary().contact());
  }
  if (answer.summary().has_seal()) stats->seal = ToSealAnswer(answer.summary().seal());
  stats->quality = ToDeformationQuality(answer.quality());
  return DecodePositions(answer.positions(), problem.mesh->num_vertices());
}

absl::StatusOr<PlanProblem> ReadProblem(const Plan& plan, const ResolveOptions& options,
                                        double* seconds) {
  const StageProgress progress("reading and checking the mesh");
  const Stopwatch stopwatch;
  absl::StatusOr<PlanProblem> problem = ResolvePlan(plan, options);
  *seconds = stopwatch.Seconds();
  return problem;
}

absl::Status Run(const RunOptions& options) {
  TF_RETURN_IF_ERROR(CheckWritable(options.out));
  if (!options.stats.empty()) TF_RETURN_IF_ERROR(CheckWritable(options.stats));
  TF_ASSIGN_OR_RETURN(const Plan plan, ReadPlan(options.plan, options.reading));
  TF_RETURN_IF_ERROR(CheckSeal(options.plan, options.reading.resolve, plan));
  double read_seconds = 0;
  TF_ASSIGN_OR_RETURN(const PlanProblem problem,
                      ReadProblem(plan, options.reading.resolve, &read_seconds));
  PredictionStats stats = StatsOf(problem);
  stats.read_seconds = read_seconds;
  TF_ASSIGN_OR_RETURN(const Positions deformed, PredictOnServer(options, problem, &stats));
  if (stats.seal && !stats.seal->released) {
    WarnOfMissingBand(problem, "it is not known of sealed lips");
  } else {
    stats.band = FindMaterialBandOrWarn(problem, deformed, /*preparation=*/nullptr);
  }
  TF_RETURN_IF_ERROR(WriteResult(options.out, plan, problem, deformed,
                                 {.material = stats.band ? &*stats.band : nullptr}, stats.seal));
  if (!options.stats.empty()) {
    stats.elastic = SummarizeElastic(problem, deformed);
    TF_RETURN_IF_ERROR(WriteStats(options.stats, stats));
  }
  PrintOutcome(options.out, stats);
  return absl::OkStatus();
}

}  // namespace

void AddRunCommand(CLI::App& app, CommandWork* work) {
  auto options = std::make_shared<RunOptions>();
  CLI::App* command = app.add_subcommand(kRunCommand.name, kRunCommand.description);
  command->add_option("PLAN", options->plan, "the plan file (docs/plan-format.md)")->required();
  AddServerOption(command, &options->server);
  command
      ->add_option("--out", options->out,
                   "the deformed mesh to write, with point array displacement_mm")
      ->required()
      ->check(VtuEnding());
  command->add_option("--stats", options->stats,
                      "also write counts, times and quality to this JSON file");
  AddPlanOptions(command, &options->reading, LipSealUse::kComputed);
  command->footer(
      "Example, in two terminals:\n"
      "  tissueform-server --port 50051\n"
      "  tissueform run plan.json --server localhost:50051 --out after.vtu\n"
      "The server stores the mesh for the next run; the session is deleted at the end.");
  command->callback([options, work] { *work = [options] { return Run(*options); }; });
}

}  // namespace tissueform
