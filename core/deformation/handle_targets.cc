// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/deformation/handle_targets.h"

#include "core/deformation/constrained_positions.h"

namespace tissueform {

HandleTargets MakeHandleTargets(const ConstraintSet& constraints,
                                const Eigen::Ref<const Positions>& rest,
                                absl::Span<const HandlePose> poses) {
  HandleTargets targets{ConstrainedPositions(rest, constraints, poses), {}};
  targets.displacements = targets.positions - rest(constraints.constrained(), Eigen::all);
  return targets;
}

Positions ToPositions(const ConstraintSet& constraints, const Eigen::Ref<const Positions>& rest,
                      const Eigen::MatrixXd& displacements, const HandleTargets& targets) {
  Positions positions = rest + displacements;
  positions(constraints.constrained(), Eigen::all) = targets.positions;
  return positions;
}

}  // namespace tissueform
