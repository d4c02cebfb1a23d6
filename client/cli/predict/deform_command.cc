// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/predict/deform_command.h"

#include <cstdio>
#include <memory>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "client/cli/shared/option_checks.h"
#include "client/cli/shared/result_writer.h"
#include "client/cli/shared/stage_progress.h"
#include "client/cli/shared/stats_json.h"
#include "core/base/atomic_file.h"
#include "core/base/parallel_for.h"
#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "core/mechanics/deformation/linear_elastic_deformer.h"
#include "core/mechanics/linear_solvers/blas_threads.h"
#include "core/planning/model_names.h"
#include "core/planning/outcome/deviations.h"
#include "core/planning/plan_io.h"

namespace tissueform {
namespace {

struct DeformOptions {
  std::string plan;
  PlanReadOptions reading;
  std::string out;
  std::string model;
  std::string stats;
  std::string deviations;
  std::string operation;
  int threads = AvailableProcessors();
  int solver_threads = 1;
};

absl::Status CheckOutputs(const DeformOptions& options) {
  TF_RETURN_IF_ERROR(CheckWritable(options.out));
  return options.stats.empty() ? absl::OkStatus() : CheckWritable(options.stats);
}

// As published where no file is named.
absl::StatusOr<Deviations> ChosenDeviations(const DeformOptions& options) {
  DeviationTable table = PublishedDeviations();
  if (!options.deviations.empty()) {
    TF_ASSIGN_OR_RETURN(table, ReadDeviations(options.deviations));
  }
  return DeviationsOf(table, options.operation);
}

absl::StatusOr<Plan> ReadChosenPlan(const DeformOptions& options) {
  TF_ASSIGN_OR_RETURN(Plan plan, ReadPlan(options.plan, options.reading));
  if (!options.model.empty()) {
    TF_ASSIGN_OR_RETURN(plan.model, ModelFromName(options.model));
  }
  return plan;
}

absl::StatusOr<PlanProblem> ResolveWithProgress(const Plan& plan, const ResolveOptions& options,
                                                double* seconds) {
  const StageProgress progress("reading and checking the mesh");
  const Stopwatch stopwatch;
  absl::StatusOr<PlanProblem> problem = ResolvePlan(plan, options);
  *seconds = stopwatch.Seconds();
  if (problem.ok()) problem->deformer.gradient_field.compute_residual = true;
  return problem;
}

absl::StatusOr<Deformation> Solve(Deformer* deformer, absl::Span<const HandlePose> poses) {
  const StageProgress progress("solving");
  return deformer->Deform(poses);
}

// Fills `stats` as far as preparing and solving know it.
absl::StatusOr<Positions> Predict(const PlanProblem& problem, const Deviations& deviations,
                                  PredictionStats* stats) {
  std::shared_ptr<MeshPreparation> preparation;
  std::unique_ptr<Deformer> deformer;
  {
    // One unless configured otherwise: more make a large factorisation faster, but the last digits
    // of the answer depend on how many there are (docs/performance.md).
    const BlasThreadsScope factorising(stats->solver_threads);
    const StageProgress progress("preparing the deformer");
    TF_ASSIGN_OR_RETURN(
        preparation, MeshPreparation::Create(*problem.mesh, problem.stiffness, problem.constraints,
                                             problem.deformer.preparation));
    TF_ASSIGN_OR_RETURN(deformer, CreateDeformer(preparation, problem.deformer));
  }
  TF_ASSIGN_OR_RETURN(Deformation deformation, Solve(deformer.get(), problem.poses));
  stats->preparation = deformer->preparation();
  stats->solve = deformation.summary;
  stats->contact = SummarizeContact(deformation.contact, problem.deformer.model);
  stats->seal = deformation.seal;
  stats->quality = MeasureDeformation(*problem.mesh, deformation.positions);
  if (deformation.seal && !deformation.seal->released) {
    WarnOfMissingBand(problem, "it is not known of sealed lips");
    return std::move(deformation.positions);
  }
  stats->band = FindMaterialBandOrWarn(problem, deformation.positions, preparation);
  if (TraitsOf(problem.deformer.model).is_elastic) {
    TF_ASSIGN_OR_RETURN(stats->total_band,
                        FindTotalBand(problem, deformation.positions, preparation.get(),
                                      stats->band ? &stats->band->expansion : nullptr, deviations));
  }
  return std::move(deformation.positions);
}

// They would go unused without a word.
void WarnOfUnusedDeviations(const DeformOptions& options, const Plan& plan) {
  const bool are_given = !options.deviations.empty() || !options.operation.empty();
  if (!are_given || TraitsOf(plan.model).is_elastic) return;
  absl::FPrintF(stderr,
                "warning: --deviations and --operation change nothing: %s has no intervals; "
                "linear_elastic and neo_hookean have\n",
                ModelName(plan.model));
}

absl::Status RunDeform(const DeformOptions& options) {
  TF_RETURN_IF_ERROR(CheckOutputs(options));
  TF_ASSIGN_OR_RETURN(const Plan plan, ReadChosenPlan(options));
  TF_RETURN_IF_ERROR(CheckSeal(options.plan, options.reading.resolve, plan));
  TF_ASSIGN_OR_RETURN(const Deviations deviations, ChosenDeviations(options));
  WarnOfUnusedDeviations(options, plan);
  double read_seconds = 0;
  TF_ASSIGN_OR_RETURN(PlanProblem problem,
                      ResolveWithProgress(plan, options.reading.resolve, &read_seconds));
  problem.deformer.preparation.threads = options.threads;
  problem.deformer.neo_hookean.newton_blas_threads = options.solver_threads;
  PredictionStats stats = StatsOf(problem);
  stats.solver_threads = options.solver_threads;
  stats.read_seconds = read_seconds;
  TF_ASSIGN_OR_RETURN(const Positions deformed, Predict(problem, deviations, &stats));
  TF_RETURN_IF_ERROR(WriteResult(options.out, plan, problem, deformed,
                                 {.material = stats.band ? &*stats.band : nullptr,
                                  .total = stats.total_band ? &*stats.total_band : nullptr},
                                 stats.seal));
  if (!options.stats.empty()) {
    stats.elastic = SummarizeElastic(problem, deformed);
    TF_RETURN_IF_ERROR(WriteStats(options.stats, stats));
  }
  PrintOutcome(options.out, stats);
  return absl::OkStatus();
}

}  // namespace

void AddDeformCommand(CLI::App& app, CommandWork* work) {
  auto options = std::make_shared<DeformOptions>();
  CLI::App* command = app.add_subcommand("deform", "predict in this process, without a server");
  command->add_option("PLAN", options->plan, "the plan file (docs/plan-format.md)")->required();
  command
      ->add_option("--out", options->out,
                   "the deformed mesh to write, with point array displacement_mm")
      ->required()
      ->check(VtuEnding());
  command->add_option("--model", options->model, "use this model instead of the plan's")
      ->check(CLI::IsMember(KnownModelNames()));
  command->add_option("--stats", options->stats,
                      "also write counts, times and quality to this JSON file");
  command
      ->add_option(
          "--deviations", options->deviations,
          "JSON file of what surgery and model err by, in place of the published figures\n"
          "(docs/accuracy.md, \"The whole band\"); `tissueform outcome cohort` writes one a model")
      ->check(CLI::ExistingFile);
  command->add_option("--operation", options->operation,
                      "take the figures of this operation instead of those of all together;\n"
                      "published is bsso_forward alone");
  command
      ->add_option("--threads", options->threads, "number of threads; does not affect the result")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  AddSolverThreads(command, "", &options->solver_threads);
  AddPlanOptions(command, &options->reading, LipSealUse::kComputed);
  command->footer(
      "Examples:\n"
      "  tissueform deform plan.json --out after.vtu\n"
      "  tissueform deform plan.json --out after.vtu --model neo_hookean --stats stats.json\n"
      "  tissueform deform plan.json --out sticking.vtu --contact off\n"
      "  tissueform deform plan.json --out sealed.vtu --model linear_elastic --seal\n"
      "Open after.vtu in ParaView or 3D Slicer; displacement_mm is the movement of each vertex.\n"
      "Elastic models add stress, strain energy and reaction forces (docs/plan-format.md).");
  command->callback([options, work] { *work = [options] { return RunDeform(*options); }; });
}

}  // namespace tissueform
