// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/deformation/handle_targets.h"

#include <vector>

namespace tissueform {

HandleTargets MakeHandleTargets(const ConstraintSet& constraints,
                                const Eigen::Ref<const Positions>& rest,
                                absl::Span<const HandlePose> poses) {
  const std::vector<int32_t>& vertices = constraints.constrained();
  std::vector<Eigen::Matrix3d> linear_parts;
  for (const HandlePose& pose : poses) {
    linear_parts.push_back(pose.scale * RotationMatrix(pose.rotation_vector));
  }
  HandleTargets targets{rest(vertices, Eigen::all), {}};
  for (Eigen::Index c = 0; c < targets.positions.rows(); ++c) {
    const int handle = constraints.region_of_constrained()[c];
    if (handle != ConstraintSet::kFixed) {
      const HandlePose& pose = poses[handle];
      const Eigen::Vector3d position = targets.positions.row(c);
      targets.positions.row(c) =
          pose.pivot_mm + linear_parts[handle] * (position - pose.pivot_mm) + pose.translation_mm;
    }
  }
  targets.displacements = targets.positions - rest(vertices, Eigen::all);
  return targets;
}

Positions ToPositions(const ConstraintSet& constraints, const Eigen::Ref<const Positions>& rest,
                      const Eigen::MatrixXd& displacements, const HandleTargets& targets) {
  Positions positions = rest + displacements;
  positions(constraints.constrained(), Eigen::all) = targets.positions;
  return positions;
}

}  // namespace tissueform
