// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

#include "core/case_file/case_file.h"
#include "core/problem/plan_problem.h"

namespace tissueform {

// The case of a plan, with surfaces of its own mesh: the skin that follows it, and where tissue
// lies on the segments. What is empty in `about` (title, provenance) stays as it is.
//
// Errors: InvalidArgument: a plan without free skin, more handles than a case holds.
absl::StatusOr<CaseFile> CaseOfPlan(const PlanProblem& problem, CaseFile about);

// "mandible" in words for people: "Lower jaw"; a name that is none of ours stays.
std::string LabelOf(const std::string& name);

}  // namespace tissueform
