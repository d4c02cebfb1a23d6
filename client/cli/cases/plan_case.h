// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>

#include "absl/status/statusor.h"

#include "core/mechanics/problem/plan_problem.h"
#include "core/planning/case_file/case_file.h"
#include "core/planning/case_file/viewer_file.h"

namespace tissueform {

// The case of a plan. With `viewer`, what lies beside its mesh: the skin of the whole head, which
// follows the mesh's, bone, segments and teeth, landmarks and head frame. Without it the surfaces
// are those of the mesh alone: its skin, and where tissue lies on the segments. What `about` has of
// title and provenance stays as it is.
//
// Errors: InvalidArgument: a mesh without free skin.
absl::StatusOr<CaseFile> CaseOfPlan(const PlanProblem& problem, CaseFile about,
                                    std::optional<ViewerFile> viewer);

// The label of "mandible" for users: "Lower jaw"; an unknown name is returned unchanged.
std::string LabelOf(const std::string& name);

}  // namespace tissueform
