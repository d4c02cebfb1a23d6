// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/types/span.h"

#include "core/base/types.h"
#include "core/constraints/constraint_set.h"
#include "core/constraints/handle_pose.h"

namespace tissueform {

// Where the poses put the constrained vertices, #constrained by 3: fixed ones stay, those of a
// handle go with its pose. `rest` is #V by 3.
Positions ConstrainedPositions(const Eigen::Ref<const Positions>& rest,
                               const ConstraintSet& constraints,
                               absl::Span<const HandlePose> poses);

}  // namespace tissueform
