// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/predict/plan_fit_command.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "client/cli/predict/plan_fit_json.h"
#include "client/cli/predict/plan_fit_report.h"
#include "client/cli/shared/option_checks.h"
#include "client/cli/shared/report_parts.h"
#include "client/cli/shared/stage_progress.h"
#include "core/base/atomic_file.h"
#include "core/base/json/json_file.h"
#include "core/base/parallel_for.h"
#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "core/mechanics/linear_solvers/blas_threads.h"
#include "core/mechanics/prepared_answers/create_response.h"
#include "core/planning/fit_targets.h"
#include "core/planning/fitted_plan.h"
#include "core/planning/model_names.h"
#include "core/planning/plan_io.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

// Far below what a target means, and near enough that the first answer of the full model is the
// last but one.
constexpr double kPreparedToleranceMm = 0.002;

struct PlanFitOptions {
  std::string plan;
  PlanReadOptions reading;
  std::string targets;
  std::string out;
  std::string report;
  std::string model;
  int threads = AvailableProcessors();
  bool overwrite = false;
  bool accept_misses = false;
  bool json = false;
};

// A plan is a user's work: unlike a result it is not replaced because its name was given again.
absl::Status CheckOut(const PlanFitOptions& options) {
  if (!options.report.empty()) TF_RETURN_IF_ERROR(CheckWritable(options.report));
  if (options.out.empty()) return absl::OkStatus();
  TF_RETURN_IF_ERROR(CheckWritable(options.out));
  std::error_code ignored;
  for (const std::string& input : {options.plan, options.targets}) {
    if (fs::equivalent(options.out, input, ignored)) {
      return absl::FailedPreconditionError(
          absl::StrCat("--out ", options.out, " would overwrite an input file; name another file"));
    }
  }
  if (fs::exists(options.out, ignored) && !options.overwrite) {
    return absl::FailedPreconditionError(
        absl::StrCat("--out ", options.out, " exists; name another file, or give --overwrite"));
  }
  return absl::OkStatus();
}

absl::Status CheckModel(const Plan& plan, const ConstraintSet& constraints) {
  if (!HasPreparedAnswers(plan.model, plan.gradient_field, constraints)) {
    const bool has_contact = !constraints.contact().empty();
    const bool by_settings = !has_contact && plan.model == DeformationModel::kGradientField;
    return absl::InvalidArgumentError(
        absl::StrCat("model ", ModelName(plan.model), by_settings ? " with these settings" : "",
                     has_contact ? " with contact" : "",
                     " has no prepared answers, which fitting needs; use --model ",
                     ModelsWithPreparedAnswers(constraints)));
  }
  const bool is_scaled = std::any_of(plan.handles.begin(), plan.handles.end(),
                                     [](const PlannedHandle& h) { return h.pose.scale != 1; });
  if (is_scaled && plan.model == DeformationModel::kNeoHookean) {
    return absl::InvalidArgumentError(
        "a handle of the plan is scaled, and neo_hookean then has no prepared answers; use "
        "--model linear_elastic or gradient_field");
  }
  return absl::OkStatus();
}

struct PreparedFit {
  std::shared_ptr<MeshPreparation> preparation;
  std::unique_ptr<Deformer> deformer;
  std::unique_ptr<VertexResponse> response;
};

absl::StatusOr<PreparedFit> Prepare(const PlanProblem& plan, const FitProblem& problem) {
  const BlasThreadsScope factorising(1);
  const StageProgress progress("preparing answers");
  PreparedFit prepared;
  TF_ASSIGN_OR_RETURN(prepared.preparation,
                      MeshPreparation::Create(*plan.mesh, plan.stiffness, plan.constraints,
                                              plan.deformer.preparation));
  TF_ASSIGN_OR_RETURN(prepared.deformer, CreateDeformer(prepared.preparation, plan.deformer));
  ResponseOptions options{.model = plan.deformer.model,
                          .tolerance_mm = kPreparedToleranceMm,
                          .max_rotation_rad = LargestFitRotation(problem),
                          .seal = plan.deformer.seal};
  for (const HandlePose& pose : problem.poses) {
    options.max_scale_change = std::max(options.max_scale_change, std::abs(pose.scale - 1));
  }
  absl::StatusOr<std::unique_ptr<VertexResponse>> response =
      CreateResponse(prepared.preparation, FitVertices(problem), options);
  if (!response.ok()) {
    return absl::Status(
        response.status().code(),
        absl::StrCat("answers cannot be prepared for these bounds: ", response.status().message(),
                     "; narrow the bounds of the rotations"));
  }
  prepared.response = *std::move(response);
  return prepared;
}

// How the fitted plan names the mesh from its own folder.
std::string MeshFrom(const std::string& out, const std::string& mesh) {
  std::error_code ignored;
  const fs::path folder = fs::weakly_canonical(fs::absolute(out, ignored), ignored).parent_path();
  const fs::path file = fs::weakly_canonical(fs::absolute(mesh, ignored), ignored);
  const fs::path relative = file.lexically_relative(folder);
  return (relative.empty() ? file : relative).string();
}

absl::Status WriteFittedPlan(const PlanFitOptions& options, const Plan& plan,
                             const PlanProblem& resolved, const FitProblem& problem,
                             const PlanFit& fit) {
  if (options.out.empty()) return absl::OkStatus();
  std::vector<HandlePose> poses;
  for (const HandlePose& pose : fit.poses) {
    poses.push_back(SwapToOrFromLps(resolved.written_in, pose));
  }
  std::vector<bool> changed(poses.size(), false);
  for (const FitUnknown& unknown : problem.unknowns) changed[unknown.handle] = true;
  TF_ASSIGN_OR_RETURN(const std::string text, ReadJsonText(options.plan, "plan", kMaxPlanBytes));
  const std::string mesh = MeshFrom(options.out, plan.mesh_path);
  TF_ASSIGN_OR_RETURN(const std::string fitted, PlanWithPoses(text, mesh, poses, changed));
  TF_RETURN_IF_ERROR(WriteFileAtomically(options.out, fitted));
  if (!fs::path(mesh).empty() &&
      (*fs::path(mesh).begin() == ".." || fs::path(mesh).is_absolute())) {
    absl::FPrintF(stderr,
                  "note: the mesh of %s is outside its folder; run it with --allow-outside\n",
                  options.out);
  }
  return absl::OkStatus();
}

absl::Status RunPlanFit(const PlanFitOptions& options) {
  TF_RETURN_IF_ERROR(CheckOut(options));
  TF_ASSIGN_OR_RETURN(Plan plan, ReadPlan(options.plan, options.reading));
  if (!options.model.empty()) {
    TF_ASSIGN_OR_RETURN(plan.model, ModelFromName(options.model));
  }
  TF_RETURN_IF_ERROR(CheckSeal(options.plan, options.reading.resolve, plan));
  TF_ASSIGN_OR_RETURN(PlanProblem resolved, ResolvePlan(plan, options.reading.resolve));
  TF_RETURN_IF_ERROR(CheckModel(plan, resolved.constraints));
  resolved.deformer.preparation.threads = options.threads;
  TF_ASSIGN_OR_RETURN(const FitRequest request, ReadFitTargets(options.targets, resolved));
  absl::StatusOr<FitProblem> problem =
      ResolveFit(request, *resolved.mesh, resolved.constraints, resolved.poses);
  if (!problem.ok()) {
    return absl::Status(problem.status().code(), absl::StrCat("targets ", options.targets, ": ",
                                                              problem.status().message()));
  }
  Stopwatch stopwatch;
  TF_ASSIGN_OR_RETURN(const PreparedFit prepared, Prepare(resolved, *problem));
  const double prepare_seconds = stopwatch.Restart();
  PlanFit fit;
  {
    const StageProgress progress("fitting");
    TF_ASSIGN_OR_RETURN(fit,
                        FitPlan(*problem, *resolved.mesh, resolved.constraints, *prepared.response,
                                {.full_model = prepared.deformer.get(), .cancellation = {}}));
  }
  const FitReport report{.plan_path = options.plan,
                         .targets_path = options.targets,
                         .out_path = options.out,
                         .model = ModelName(plan.model),
                         .plan = &resolved,
                         .problem = &*problem,
                         .fit = &fit,
                         .prepare_seconds = prepare_seconds,
                         .fit_seconds = stopwatch.Seconds()};
  TF_RETURN_IF_ERROR(WriteFittedPlan(options, plan, resolved, *problem, fit));
  const auto json = FitReportJson(report);
  if (!options.report.empty()) {
    TF_RETURN_IF_ERROR(WriteFileAtomically(options.report, json.dump(2) + "\n"));
  }
  PrintReport(options.json, FitReportText(report), json);
  if (!fit.converged || !fit.model_converged) {
    absl::FPrintF(stderr, "warning: %s\n",
                  fit.model_converged ? "the search has not converged; the best result is shown"
                                      : "the model has not converged at the fitted poses");
  }
  return options.accept_misses ? absl::OkStatus() : CheckReached(report);
}

constexpr char kFooter[] =
    "TARGETS.json states the targets for points of the skin and the free movements of bone, in mm "
    "and "
    "degrees, in\nthe plan's axes:\n"
    "  {\"format\": \"tissueform-targets\", \"version\": 1, \"unit\": \"mm\", "
    "\"coordinate_system\": \"LPS\",\n"
    "   \"free\": [{\"handle\": \"mandible\", \"translation_mm\": [null, [-10, 5], [-3, 3]],\n"
    "             \"rotation_vector_deg\": [[-5, 5], null, null]}],\n"
    "   \"targets\": [{\"at\": {\"place\": \"chin\"}, \"along\": \"forward\", \"by_mm\": 5}],\n"
    "   \"symmetric\": true}\n"
    "A target is at a named place, at a point on the skin (\"point_mm\") or at vertices that a "
    "selector names;\nits goal is by_mm along a direction, a vector (\"move_mm\") or a "
    "position (\"to_mm\"). Handles that are not\nfree, and null, do not move. All keys: "
    "docs/plan-fitting.md.\n\n"
    "The report states which targets are reached (by the full model), which are missed and by how "
    "much, which "
    "bounds\nare active, and how well the targets determine each number.\n\n"
    "Examples:\n"
    "  tissueform plan fit head/plan.json --targets chin.json\n"
    "  tissueform plan fit head/plan.json --targets chin.json --out head/fitted.json\n"
    "  tissueform deform head/fitted.json --out after.vtu\n"
    "Exit codes: 0 done, 1 the work failed or a target is not reached (the plan is still "
    "written), 2 wrong use.";

}  // namespace

void AddPlanFitCommand(CLI::App& app, CommandWork* work) {
  auto options = std::make_shared<PlanFitOptions>();
  CLI::App* fit = app.add_subcommand("fit", "find the bone poses that reach soft-tissue targets");
  fit->add_option("PLAN", options->plan, "the plan file (docs/plan-format.md)")->required();
  fit->add_option("--targets", options->targets, "the targets and the free movements, see below")
      ->required();
  fit->add_option("--out", options->out, "write a plan with the fitted poses");
  fit->add_option("--report", options->report,
                  "also write the report, with more details, to this JSON file");
  fit->add_option("--model", options->model, "use this model instead of the plan's")
      ->check(CLI::IsMember(KnownModelNames()));
  fit->add_option("--threads", options->threads, "number of threads; does not affect the result")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  fit->add_flag("--overwrite", options->overwrite, "replace an existing file");
  fit->add_flag("--accept-misses", options->accept_misses,
                "exit code 0 even if a target is not reached; the report still states it");
  fit->add_flag("--json", options->json, "print the report as JSON");
  AddPlanOptions(fit, &options->reading, LipSealUse::kComputed);
  fit->footer(kFooter);
  fit->callback([options, work] { *work = [options] { return RunPlanFit(*options); }; });
}

}  // namespace tissueform
