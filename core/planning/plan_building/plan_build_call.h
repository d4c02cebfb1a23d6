// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/base/process/helper_program.h"

namespace tissueform {

// A plan from a CT, made by the program tissueform-plan-build: neither a crash of ITK, CGAL or VTK
// nor the memory that they take is the caller's, who links none of them.
struct PlanBuildRequest {
  std::string ct;             // file or folder, as BuildPlan takes it, or a zip of it
  std::string recipe;         // file; may be empty where only labels are compared
  std::string surfaces = {};  // file, instead of both, as BuildPlanFromSurfaces takes it, or a zip
  std::string labels =
      {};  // file of a label map, or a zip of it; empty: that of the recipe, if it names one
  bool only_compare_labels = false;  // no plan: the answer's text compares them with the CT
  bool only_write_inputs = false;    // no plan: the folder gets the BuildInputFiles
  // Is there and empty; gets the plan and its report. Zips are unpacked in it, and removed again.
  std::string folder;
  std::string folder_name;  // what the answer calls it, for it may be renamed afterwards
  int threads = 1;          // the plan does not depend on it
  bool pictures = true;     // in the report: they need an X display or Xvfb
  // As much as there is: how much a CT needs is not known before it is read.
  IsolationLimits limits = {.max_memory_bytes = std::numeric_limits<int64_t>::max(),
                            .max_seconds = std::numeric_limits<int>::max(),
                            .max_file_bytes = std::numeric_limits<int64_t>::max()};
};

// What another machine needs to build the same plan, in request.folder, without anything that names
// the patient; those of a request without surfaces, or kSurfaces alone.
struct BuildInputFiles {
  static constexpr char kCt[] = "ct.mha";
  static constexpr char kRecipe[] = "recipe.json";
  static constexpr char kLabels[] = "labels";      // with the ending of its format, if there is one
  static constexpr char kRecipeFiles[] = "files";  // a folder: as the recipe names them
  static constexpr char kSurfaces[] = "surfaces.zip";
};

struct PlanBuildCallOptions {
  // Called with what begins and how much of the whole is done, in [0, 1], rising; on the caller's
  // thread.
  std::function<void(absl::string_view stage, double fraction)> on_progress;
  // A descriptor (of a pipe, signalfd, eventfd); the call ends when it becomes readable. -1: none.
  int cancel = -1;
};

// What was made.
struct PlanBuildAnswer {
  std::string text;     // for the user: what was made, and what to mind
  bool ready = false;   // whether it meets all requirements; report.json says the same
  std::string defects;  // which it misses and by how much; empty when it is ready
};

// Fills request.folder, also with a plan that misses requirements. When this function has returned,
// no process writes into the folder; after an error, the caller removes what is left in it
// (AtomicFolder does). Any thread may call it, many at once; when this process dies, the work ends
// too.
//
// Errors: those of ReadRecipe, BuildPlan, WritePlan and WritePlanReport; Cancelled; Internal when a
// library crashes, ResourceExhausted when the work is killed; NotFound when the program is not
// there.
absl::StatusOr<PlanBuildAnswer> CallPlanBuild(const PlanBuildRequest& request,
                                              const PlanBuildCallOptions& options = {});

// The other side: what the program does with a request.
using PlanBuildWork = std::function<absl::StatusOr<PlanBuildAnswer>(
    const PlanBuildRequest& request,
    const std::function<void(absl::string_view stage, double fraction)>& on_stage)>;

// What main() of the program returns: takes one request from its caller, and answers.
int RunPlanBuildProgram(const PlanBuildWork& work);

}  // namespace tissueform
