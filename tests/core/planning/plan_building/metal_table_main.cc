// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// Prints the table of docs/ct-input.md, plans of CTs with metal against the plan without:
// tissueform-metal-table FOLDER [auto|off], where tissueform-metal-ct has written its files. With
// one of the two words for the recipe's "metal", of that only. A line each plan, as soon as it is
// there; the whole takes some minutes.

#include <iostream>
#include <string>
#include <vector>

#include "core/base/parallel_for.h"
#include "core/base/status_macros.h"
#include "core/mechanics/linear_solvers/blas_threads.h"
#include "tests/core/planning/plan_building/plan_comparison.h"

namespace tissueform::testing {
namespace {

absl::Status PrintRow(const std::string& name, const PlanBuild& plan, const PlanBuild& truth) {
  TF_ASSIGN_OR_RETURN(const PlanDifference difference,
                      ComparePlans(plan, truth, DeformationModel::kLinearElastic));
  std::cout << TableRow(name, difference) << std::flush;
  return absl::OkStatus();
}

absl::Status PrintTable(const std::string& folder, const std::vector<bool>& corrections) {
  const PlanBuildOptions options{.threads = AvailableProcessors(), .on_stage = {}};
  TF_ASSIGN_OR_RETURN(const PlanBuild truth,
                      BuildPlan(folder + "/free.nrrd", MetalRecipe(true), options));
  std::cout << TableHead();
  TF_RETURN_IF_ERROR(PrintRow("no metal, the same", truth, truth));
  TF_ASSIGN_OR_RETURN(const PlanBuild again,
                      BuildPlan(folder + "/again.nrrd", MetalRecipe(true), options));
  TF_RETURN_IF_ERROR(PrintRow("no metal, other noise", again, truth));
  for (const char* kind : {"fillings", "braces"}) {
    for (const bool correct : corrections) {
      TF_ASSIGN_OR_RETURN(const PlanBuild plan,
                          BuildPlan(folder + "/" + kind + ".nrrd", MetalRecipe(correct), options));
      const std::string name = std::string(kind) + (correct ? ", corrected" : ", `metal` off");
      TF_RETURN_IF_ERROR(PrintRow(name, plan, truth));
    }
  }
  return absl::OkStatus();
}

}  // namespace
}  // namespace tissueform::testing

int main(int argc, char** argv) {
  const std::string which = argc == 3 ? argv[2] : "";
  if (argc < 2 || argc > 3 || (argc == 3 && which != "auto" && which != "off")) {
    std::cerr << "usage: tissueform-metal-table FOLDER [auto|off]\n";
    return 2;
  }
  std::vector<bool> corrections;
  if (which != "auto") corrections.push_back(false);
  if (which != "off") corrections.push_back(true);
  tissueform::SetBlasThreads(1);
  const absl::Status printed = tissueform::testing::PrintTable(argv[1], corrections);
  if (printed.ok()) return 0;
  std::cerr << printed.message() << '\n';
  return 1;
}
