// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

#include "core/mechanics/problem/plan_problem.h"
#include "core/planning/case_file/case_file.h"

namespace tissueform {

// What was planned: a problem that models can solve, and the surfaces that follow its mesh.
struct PreOperativePlan {
  PlanProblem problem;
  CaseFile contents;
};

// Reads a plan with its viewer file, or a case (.tfcase). A case holds everything but the plan's
// material ranges and seal, which a comparison does not use.
//
// Errors: those of OpenPlan, ReadCase, ToSessionRequest and ConstraintSet::Create; InvalidArgument
// where a plan has no viewer file: without skin and bone there is nothing to register.
absl::StatusOr<PreOperativePlan> ReadPreOperative(const std::string& path);

}  // namespace tissueform
