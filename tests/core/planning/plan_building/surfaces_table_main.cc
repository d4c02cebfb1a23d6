// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// tissueform-surfaces-table: makes one head's plan from its CT and from the surfaces of skin and
// bones of that CT, and prints how far the two are apart.
//
// usage: tissueform-surfaces-table CT RECIPE.json SURFACES_TEMPLATE.json FOLDER
//
// FOLDER gets skin.stl, skull.stl, lower_jaw.stl and surfaces.json; the template says all besides
// the three surfaces.

#include <cstdio>
#include <fstream>
#include <string>

#include "nlohmann/json.hpp"

#include "core/base/status_macros.h"
#include "core/mechanics/linear_solvers/blas_threads.h"
#include "core/planning/plan_building/plan_builder.h"
#include "tests/core/planning/plan_building/exported_head.h"
#include "tests/core/planning/plan_building/plan_comparison.h"

namespace tissueform::testing {
namespace {

constexpr int kThreads = 2;

absl::Status Run(char** arguments) {
  const std::string folder = arguments[4];
  TF_ASSIGN_OR_RETURN(const Recipe recipe, ReadRecipe(arguments[2]));
  TF_ASSIGN_OR_RETURN(const PlanBuild ct,
                      BuildPlan(arguments[1], recipe, {.threads = kThreads, .on_stage = {}}));
  TF_ASSIGN_OR_RETURN(const ExportedHead head, ExportHead(ct.head.hu, ct.parts.labels, 4));
  TF_RETURN_IF_ERROR(WriteHead(head, folder));
  nlohmann::json json = nlohmann::json::parse(std::ifstream(arguments[3]));
  for (const char* name : {"skin", "skull", "lower_jaw"}) {
    json[name] = {{"file", std::string(name) + ".stl"}};
  }
  std::ofstream(folder + "/surfaces.json") << json.dump(2);
  TF_ASSIGN_OR_RETURN(
      const PlanBuild surfaces,
      BuildPlanFromSurfaces(folder + "/surfaces.json", {.threads = kThreads, .on_stage = {}}));
  TF_ASSIGN_OR_RETURN(const PlanDifference difference,
                      ComparePlans(surfaces, ct, DeformationModel::kLinearElastic));
  std::printf("%s%s\nlargest difference of movement %.2f mm; segment volumes %.1f and %.1f cm3\n",
              TableHead().c_str(), TableRow("surfaces", difference).c_str(), difference.movement.mm,
              surfaces.segments[0].volume_mm3 / 1000, ct.segments[0].volume_mm3 / 1000);
  return absl::OkStatus();
}

}  // namespace
}  // namespace tissueform::testing

int main(int argc, char** argv) {
  tissueform::RestartWithFittingBlasKernels(argv);
  if (argc != 5) {
    std::fprintf(stderr, "usage: %s CT RECIPE.json SURFACES_TEMPLATE.json FOLDER\n", argv[0]);
    return 2;
  }
  const absl::Status status = tissueform::testing::Run(argv);
  if (!status.ok()) std::fprintf(stderr, "%s\n", std::string(status.message()).c_str());
  return status.ok() ? 0 : 1;
}
