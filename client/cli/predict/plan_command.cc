// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/predict/plan_command.h"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <numbers>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "client/cli/plan_build/ending_signals.h"
#include "client/cli/shared/option_checks.h"
#include "core/base/atomic_folder.h"
#include "core/base/parallel_for.h"
#include "core/base/random_id.h"
#include "core/base/status_macros.h"
#include "core/mesh/mesh_defect.h"
#include "core/planning/model_names.h"
#include "core/planning/plan_building/plan_build_call.h"
#include "core/planning/plan_io.h"

namespace tissueform {
namespace {

std::string DescribePose(const HandlePose& pose) {
  const double degrees = pose.rotation_vector.norm() * 180.0 / std::numbers::pi;
  return absl::StrFormat("moves %.3g mm, turns %.4g degrees, scale %.4g",
                         pose.translation_mm.norm(), degrees, pose.scale);
}

void PrintUncertainty(const MaterialUncertainty& uncertainty) {
  for (const MaterialUncertainty::Tissue& tissue : uncertainty.tissues) {
    absl::PrintF("  uncertain  %s: stiffness x 1/%.4g to x %.4g (95 %% interval)\n", tissue.name,
                 tissue.factor_95, tissue.factor_95);
  }
  if (const auto& range = uncertainty.poisson_ratio_95) {
    absl::PrintF("  uncertain  Poisson's ratio: %.4g to %.4g (95 %% interval)\n", (*range)[0],
                 (*range)[1]);
  }
}

void PrintContact(const PlanProblem& problem) {
  const std::vector<ContactRow>& rows = problem.constraints.contact();
  if (problem.contact_use == ContactUse::kLeftOut) {
    absl::PrintF("  contact    off: tissue sticks and the lips are one piece\n");
  } else if (!rows.empty()) {
    absl::PrintF("  contact    %d rows, of them %d bilateral\n", rows.size(),
                 std::ranges::count_if(rows, &ContactRow::bilateral));
  }
}

void PrintPlan(const std::string& path, const Plan& plan, const PlanProblem& problem) {
  absl::PrintF("plan   %s\n", path);
  absl::PrintF("  mesh       %s: %d vertices, %d tets, %s\n", plan.mesh_path,
               problem.mesh->num_vertices(), problem.mesh->num_tets(),
               plan.coordinate_system == CoordinateSystem::kRas ? "RAS" : "LPS");
  if (const auto size = FindImplausibleSize(problem.mesh->positions())) {
    absl::PrintF("  warning    %s\n", size->explanation);
  }
  absl::PrintF("  stiffness  %.6g to %.6g Pa\n", problem.stiffness.minCoeff(),
               problem.stiffness.maxCoeff());
  if (problem.uncertainty) PrintUncertainty(*problem.uncertainty);
  absl::PrintF("  fixed      %d vertices\n", problem.constraints.fixed().size());
  for (size_t h = 0; h < plan.handles.size(); ++h) {
    const HandleRegion& region = problem.constraints.handles()[h];
    absl::PrintF("  handle     %s: %d vertices, %s\n", region.name, region.vertices.size(),
                 DescribePose(problem.poses[h]));
  }
  PrintContact(problem);
  absl::PrintF("  model      %s, rotation %s\n", ModelName(plan.model),
               RotationModeName(plan.gradient_field.rotation));
  absl::PrintF("the plan is ready: tissueform deform %s --out after.vtu\n", path);
}

struct PlanCheckOptions {
  std::string plan;
  std::string labels;
  std::string ct;
  std::string recipe;
  PlanReadOptions reading;
};

// Zips are unpacked in a folder that is never published, and so goes with this function.
absl::StatusOr<PlanBuildAnswer> CallComparison(const PlanCheckOptions& options, int cancel) {
  const std::filesystem::path folder = std::filesystem::temp_directory_path();
  TF_ASSIGN_OR_RETURN(const AtomicFolder work,
                      AtomicFolder::Create((folder / ("tissueform-" + RandomId())).string()));
  return CallPlanBuild({.ct = options.ct,
                        .recipe = options.recipe,
                        .labels = options.labels,
                        .only_compare_labels = true,
                        .folder = work.path(),
                        .folder_name = {},
                        .threads = AvailableProcessors()},
                       {.on_progress = nullptr, .cancel = cancel});
}

// The Dice coefficients of a label map and of our own segmentation.
absl::Status CompareLabels(const PlanCheckOptions& options) {
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<EndingSignals> signals, EndingSignals::Catch());
  const absl::StatusOr<PlanBuildAnswer> answer = CallComparison(options, signals->descriptor());
  if (absl::IsCancelled(answer.status())) signals->EndByArrived();
  TF_RETURN_IF_ERROR(answer.status());
  absl::PrintF("%s", answer->text);
  return absl::OkStatus();
}

absl::Status RunPlanCheck(const PlanCheckOptions& options) {
  if (!options.labels.empty()) return CompareLabels(options);
  TF_ASSIGN_OR_RETURN(const Plan plan, ReadPlan(options.plan, options.reading));
  TF_ASSIGN_OR_RETURN(const PlanProblem problem, ResolvePlan(plan, options.reading.resolve));
  PrintPlan(options.plan, plan, problem);
  return absl::OkStatus();
}

}  // namespace

CLI::App* AddPlanCommand(CLI::App& app, CommandWork* work) {
  CLI::App* plan = app.add_subcommand("plan", "work on plan files");
  plan->footer(
      "Examples:\n"
      "  tissueform plan build --ct series/ --recipe recipe.json --out head\n"
      "  tissueform plan check head/plan.json\n"
      "  tissueform plan fit head/plan.json --targets chin.json --out head/fitted.json\n"
      "  tissueform plan export --slicer scene head/plan.json");

  auto options = std::make_shared<PlanCheckOptions>();
  CLI::App* check = plan->add_subcommand("check", "check a plan and its mesh, and summarize it");
  CLI::Option* file =
      check->add_option("PLAN", options->plan, "the plan file (docs/plan-format.md)");
  CLI::Option* ct =
      check->add_option("--ct", options->ct, "with --labels: their CT, or a zip of it");
  CLI::Option* labels = check->add_option(
      "--labels", options->labels,
      "instead of a plan: compare a label map with the segmentation of its CT (Dice coefficients)");
  CLI::Option* recipe = check->add_option("--recipe", options->recipe,
                                          "with --labels: a recipe with its keys \"ct\", "
                                          "\"segmentation\" and \"labels\"");
  labels->needs(ct)->excludes(file);
  ct->needs(labels);
  recipe->needs(labels);
  AddPlanOptions(check, &options->reading);
  check->footer(
      "Examples:\n"
      "  tissueform plan check plan.json\n"
      "  tissueform plan check --ct series/ --labels bones.seg.nrrd\n"
      "Exit code 0: the plan is valid. 1: it is not; the line on stderr names the key and what "
      "to do.");
  check->callback([options, work] {
    if (options->plan.empty() && options->labels.empty()) throw CLI::RequiredError("PLAN");
    *work = [options] { return RunPlanCheck(*options); };
  });
  return plan;
}

}  // namespace tissueform
