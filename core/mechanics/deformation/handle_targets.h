// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/types/span.h"

#include "core/base/types.h"
#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/constraints/handle_pose.h"

namespace tissueform {

// Where the poses put the constrained vertices, #constrained by 3: fixed ones stay, those of a
// handle go with its pose. `rest` is #V by 3.
Positions ConstrainedPositions(const Eigen::Ref<const Positions>& rest,
                               const ConstraintSet& constraints,
                               absl::Span<const HandlePose> poses);

// Where the constrained vertices go, #constrained by 3, in the order of constraints.constrained(),
// and bone with them.
struct HandleTargets {
  Positions positions;
  Positions displacements;  // against rest; zero to the bit for handles with an identity pose
  // The gap in mm that every contact row would have if tissue stayed and only bone moved.
  Eigen::VectorXd resting_gaps;
};

// REQUIRES: one legal pose per handle; `rest` is #V by 3.
HandleTargets MakeHandleTargets(const ConstraintSet& constraints,
                                const Eigen::Ref<const Positions>& rest,
                                absl::Span<const HandlePose> poses);

// rest + displacements, with constrained vertices exactly where their poses put them, not up to the
// rounding of adding and taking away.
Positions ToPositions(const ConstraintSet& constraints, const Eigen::Ref<const Positions>& rest,
                      const Eigen::MatrixXd& displacements, const HandleTargets& targets);

}  // namespace tissueform
