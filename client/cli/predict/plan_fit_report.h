// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"

#include "core/mechanics/plan_fitting/fit_problem.h"
#include "core/mechanics/plan_fitting/plan_fit.h"
#include "core/planning/plan.h"

namespace tissueform {

// A fit with all that its reports state.
struct FitReport {
  std::string plan_path;
  std::string targets_path;
  std::string out_path;  // may be empty
  std::string model;
  const PlanProblem* plan = nullptr;
  const FitProblem* problem = nullptr;
  const PlanFit* fit = nullptr;
  double prepare_seconds = 0;  // factors, columns and the model
  double fit_seconds = 0;      // with the answers of the full model
};

// Numbers in mm and degrees, in the axes of the plan.
std::string FitReportText(const FitReport& report);

// FailedPrecondition in one line when a target is missed by more than the tolerance: those that
// contradict each other, with both misses; otherwise the one that is missed most.
absl::Status CheckReached(const FitReport& report);

}  // namespace tissueform
