// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/predict/plan_export_command.h"

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_format.h"

#include "client/cli/predict/slicer_scene.h"
#include "client/cli/shared/option_checks.h"
#include "client/cli/shared/stage_progress.h"
#include "core/base/atomic_folder.h"
#include "core/base/parallel_for.h"
#include "core/base/status_macros.h"
#include "core/mechanics/deformation/create_deformer.h"
#include "core/mechanics/linear_solvers/blas_threads.h"
#include "core/planning/model_names.h"
#include "core/planning/plan_io.h"

namespace tissueform {
namespace {

struct ExportOptions {
  std::string plan;
  PlanReadOptions reading;
  std::string folder;
  std::string model;
  int threads = AvailableProcessors();
};

absl::StatusOr<Positions> PredictFace(const PlanProblem& problem) {
  const BlasThreadsScope factorizing(1);  // as deform does: the last digits depend on it
  const StageProgress progress("predicting the face");
  TF_ASSIGN_OR_RETURN(
      const std::unique_ptr<Deformer> deformer,
      CreateDeformer(*problem.mesh, problem.stiffness, problem.constraints, problem.deformer));
  TF_ASSIGN_OR_RETURN(Deformation deformation, deformer->Deform(problem.poses));
  return std::move(deformation.positions);
}

absl::Status RunExport(const ExportOptions& options) {
  TF_RETURN_IF_ERROR(CheckFillable(options.folder));
  TF_ASSIGN_OR_RETURN(Plan plan, ReadPlan(options.plan, options.reading));
  if (!options.model.empty()) {
    TF_ASSIGN_OR_RETURN(plan.model, ModelFromName(options.model));
  }
  TF_ASSIGN_OR_RETURN(PlanProblem problem, ResolvePlan(plan, options.reading.resolve));
  problem.deformer.preparation.threads = options.threads;
  TF_ASSIGN_OR_RETURN(std::optional<ViewerFile> viewer, FindViewerOf(plan.mesh_path));
  TF_ASSIGN_OR_RETURN(const Positions deformed, PredictFace(problem));
  TF_ASSIGN_OR_RETURN(AtomicFolder folder, AtomicFolder::Create(options.folder));
  TF_RETURN_IF_ERROR(WriteSlicerScene(problem, std::move(viewer), deformed, folder.path()));
  TF_RETURN_IF_ERROR(folder.Publish());
  absl::PrintF("scene   %s/scene.mrml: open it in 3D Slicer (File, Add Data)\n", options.folder);
  return absl::OkStatus();
}

}  // namespace

void AddPlanExportCommand(CLI::App& app, CommandWork* work) {
  auto options = std::make_shared<ExportOptions>();
  CLI::App* command =
      app.add_subcommand("export", "write a plan and its prediction as a scene of 3D Slicer");
  command->add_option("PLAN", options->plan, "the plan file (docs/plan-format.md)")->required();
  command
      ->add_option("--slicer", options->folder,
                   "folder for the scene: a new or an empty one; it shows the patient's face")
      ->required();
  command->add_option("--model", options->model, "use this model instead of the plan's")
      ->check(CLI::IsMember(KnownModelNames()));
  command
      ->add_option("--threads", options->threads, "number of threads; does not affect the result")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  AddPlanOptions(command, &options->reading);
  command->footer(
      "DIR gets scene.mrml, which loads the rest: face.vtp and face_predicted.vtp (point array "
      "displacement_mm), bones as .ply, movements as .tfm, landmarks as .mrk.json; all in LPS and "
      "mm. A .tfm holds the inverse of the movement, as 3D Slicer stores transforms.\n\n"
      "Examples:\n"
      "  tissueform plan export --slicer scene head/plan.json\n"
      "  tissueform plan export --slicer scene head/plan.json --model linear_elastic\n"
      "Exit codes: 0 done, 1 the work failed, 2 wrong use.");
  command->callback([options, work] { *work = [options] { return RunExport(*options); }; });
}

}  // namespace tissueform
