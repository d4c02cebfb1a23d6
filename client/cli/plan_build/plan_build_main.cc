// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// The program that `tissueform plan build` starts, as does any other caller of CallPlanBuild: makes
// a plan from a CT, and the report of it.

#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "client/cli/shared/version.h"
#include "core/base/status_macros.h"
#include "core/mechanics/linear_solvers/blas_threads.h"
#include "core/planning/plan_building/build_inputs.h"
#include "core/planning/plan_building/plan_build_call.h"
#include "core/planning/plan_building/plan_builder.h"
#include "core/planning/plan_building/zip_inputs.h"
#include "core/planning/plan_report/cautions.h"
#include "core/planning/plan_report/labels_report.h"
#include "core/planning/plan_report/plan_measures.h"
#include "core/planning/plan_report/plan_report.h"
#include "core/planning/rendering/virtual_display.h"

namespace tissueform {
namespace {

// Of the whole work's time: what building, without writing and the report, takes.
constexpr double kBuildShare = 0.8;

StageFunction Within(const StageFunction& on_stage, double from, double to) {
  return [on_stage, from, to](absl::string_view stage, double fraction) {
    if (stage != "done") on_stage(stage, from + (to - from) * fraction);
  };
}

// What is printed when a plan was made.
PlanBuildAnswer Outcome(const PlanBuildRequest& request, const PlanBuild& build) {
  const std::vector<QualityCheck> checks = CheckQuality(build, MeasurePlan(build));
  PlanBuildAnswer made{.text = {}, .ready = AllPassed(checks), .defects = FailedText(checks)};
  made.text = absl::StrFormat("plan    %s/plan.json: %d vertices, %d tets\n", request.folder_name,
                              build.mesh.mesh.num_vertices(), build.mesh.mesh.num_tets());
  for (const BuiltSegment& segment : build.segments) {
    absl::StrAppendFormat(&made.text, "  handle  %s (%s): %.1f cm3 of bone\n", segment.cut.name,
                          OsteotomyKindName(segment.cut.kind), segment.volume_mm3 / 1000);
  }
  for (const std::string& note : build.ct.notes) {
    absl::StrAppend(&made.text, request.surfaces.empty() ? "CT      " : "input   ", note, "\n");
  }
  if (build.labels) absl::StrAppend(&made.text, LabelsText(*build.labels));
  absl::StrAppendFormat(&made.text, "report  %s/report.html: %s\n", request.folder_name,
                        made.ready
                            ? "all quality requirements are met"
                            : absl::StrCat("NOT all quality requirements are met: ", made.defects));
  for (const std::string& caution : Cautions(build)) {
    absl::StrAppend(&made.text, "mind    ", caution, "\n");
  }
  if (made.ready) {
    absl::StrAppend(&made.text, "the plan is ready: tissueform deform ", request.folder_name,
                    "/plan.json --out after.vtu\n");
  } else {
    absl::StrAppend(&made.text, "the plan in ", request.folder_name,
                    " is NOT ready: see the report\n");
  }
  return made;
}

absl::StatusOr<Recipe> RecipeOf(const PlanBuildRequest& request) {
  Recipe recipe;
  if (!request.recipe.empty()) {
    TF_ASSIGN_OR_RETURN(recipe, ReadRecipe(request.recipe));
  }
  if (!request.labels.empty()) recipe.labels.file = request.labels;
  return recipe;
}

// The request with zips replaced by what they hold.
absl::StatusOr<std::string> ResolveCt(const PlanBuildRequest& request, ZipInputs* zips,
                                      Recipe* recipe) {
  if (!recipe->labels.file.empty()) {
    TF_ASSIGN_OR_RETURN(recipe->labels.file,
                        zips->Resolve(recipe->labels.file, ZipContent::kLabels));
  }
  return zips->Resolve(request.ct, ZipContent::kCt);
}

absl::StatusOr<PlanBuild> BuildFromInput(const PlanBuildRequest& request,
                                         const StageFunction& on_stage) {
  const PlanBuildOptions options{.threads = request.threads,
                                 .on_stage = Within(on_stage, 0, kBuildShare)};
  // The caller removes the folder after an error, also when this process is killed.
  ZipInputs zips(request.folder);
  if (!request.surfaces.empty()) {
    TF_ASSIGN_OR_RETURN(const std::string surfaces,
                        zips.Resolve(request.surfaces, ZipContent::kSurfaces));
    return BuildPlanFromSurfaces(surfaces, options);
  }
  TF_ASSIGN_OR_RETURN(Recipe recipe, RecipeOf(request));
  TF_ASSIGN_OR_RETURN(const std::string ct, ResolveCt(request, &zips, &recipe));
  return BuildPlan(ct, recipe, options);
}

absl::StatusOr<PlanBuildAnswer> CompareRequestedLabels(const PlanBuildRequest& request,
                                                       const StageFunction& on_stage) {
  ZipInputs zips(request.folder);
  TF_ASSIGN_OR_RETURN(Recipe recipe, RecipeOf(request));
  TF_ASSIGN_OR_RETURN(const std::string ct, ResolveCt(request, &zips, &recipe));
  TF_ASSIGN_OR_RETURN(const PlanLabels labels,
                      CompareWithLabels(ct, recipe, {request.threads, on_stage}));
  return PlanBuildAnswer{.text = LabelsText(labels), .ready = true, .defects = {}};
}

absl::StatusOr<PlanBuildAnswer> WriteRequestedInputs(const PlanBuildRequest& request,
                                                     const StageFunction& on_stage) {
  on_stage("reading the inputs", 0);
  ZipInputs zips(request.folder);
  TF_ASSIGN_OR_RETURN(const std::vector<std::string> notes, WriteBuildInputs(request, &zips));
  PlanBuildAnswer made{.text = {}, .ready = true, .defects = {}};
  for (const std::string& note : notes) absl::StrAppend(&made.text, "CT      ", note, "\n");
  return made;
}

absl::StatusOr<PlanBuildAnswer> BuildRequestedPlan(const PlanBuildRequest& request,
                                                   const StageFunction& on_stage) {
  if (request.only_compare_labels) return CompareRequestedLabels(request, on_stage);
  if (request.only_write_inputs) return WriteRequestedInputs(request, on_stage);
  // As deform does: the last digits would depend on their number, and with them what the trial of
  // the planned move finds torn. Threads that wait for each other also cost more than they give.
  SetBlasThreads(1);
  std::unique_ptr<VirtualDisplay> display;
  if (request.pictures) {
    // First, so that a missing program is reported before the work.
    TF_ASSIGN_OR_RETURN(display, VirtualDisplay::Open());
  }
  TF_ASSIGN_OR_RETURN(const PlanBuild build, BuildFromInput(request, on_stage));
  on_stage("writing the plan", kBuildShare);
  TF_RETURN_IF_ERROR(WritePlan(build, request.folder));
  TF_RETURN_IF_ERROR(WritePlanReport(build,
                                     {.program_version = kVersion,
                                      .pictures = request.pictures,
                                      .on_stage = Within(on_stage, kBuildShare + 0.05, 1)},
                                     request.folder));
  return Outcome(request, build);
}

}  // namespace
}  // namespace tissueform

int main(int /*argc*/, char** argv) {
  tissueform::RestartWithFittingBlasKernels(argv);
  return tissueform::RunPlanBuildProgram(tissueform::BuildRequestedPlan);
}
