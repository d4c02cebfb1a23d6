// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "client/lab/accuracy/accuracy_case.h"

namespace tissueform {

// The names of docs/accuracy.md's cases in its order: bars, layered block, tongue, heads.
const std::vector<std::string>& AccuracyCaseNames();

// The file of a bundled plan by the plan's name.
using PlanFinder = std::function<absl::StatusOr<std::string>(const std::string& name)>;

// The case of that name as docs/accuracy.md has it.
//
// Errors: NotFound (no such case), those of `find_plan`, ReadPlan and ResolvePlan.
absl::StatusOr<AccuracyCase> CreateAccuracyCase(const std::string& name,
                                                const PlanFinder& find_plan);

}  // namespace tissueform
