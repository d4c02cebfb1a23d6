// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"

#include "core/mechanics/constraints/handle_pose.h"

namespace tissueform {

// A plan's text with these poses (in its own axes, one a handle) in place of its own, for those
// handles that `changed` marks; all else stays, but for the mesh, which is named from another
// folder: `mesh` takes its place, and what a planner says of the old poses, which goes. The rest of
// a plan's text is not read again.
//
// REQUIRES: `plan` has passed ParsePlan.
absl::StatusOr<std::string> PlanWithPoses(std::string_view plan, const std::string& mesh,
                                          absl::Span<const HandlePose> poses,
                                          const std::vector<bool>& changed);

}  // namespace tissueform
