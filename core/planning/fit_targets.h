// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <string_view>

#include "absl/status/statusor.h"

#include "core/mechanics/plan_fitting/fit_request.h"
#include "core/mechanics/problem/plan_problem.h"

namespace tissueform {

// Largest file of targets that is read.
inline constexpr size_t kMaxTargetsBytes = size_t{1} << 20;

// The text of docs/targets.schema.json.
const char* FitTargetsSchemaText();

// Reads a file of targets (docs/plan-fitting.md) for a plan that has been put upon its mesh:
// checked against the published schema, which is built into the program; places are looked up in
// the mesh.
//
// Errors: NotFound (no such file), ResourceExhausted (larger than kMaxTargetsBytes),
// InvalidArgument: not JSON, unknown key, wrong type, value out of range (by JSON pointer); other
// axes than the plan's; a target by its name whose place the mesh has not, or that says in no way
// or in two which point it is or what it is to do.
absl::StatusOr<FitRequest> ReadFitTargets(const std::string& path, const PlanProblem& problem);

// The same for a text; `name` stands for the file in messages.
absl::StatusOr<FitRequest> ParseFitTargets(std::string_view json, const std::string& name,
                                           const PlanProblem& problem);

}  // namespace tissueform
