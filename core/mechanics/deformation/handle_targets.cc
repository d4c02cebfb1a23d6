// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/handle_targets.h"

#include <vector>

namespace tissueform {

Positions ConstrainedPositions(const Eigen::Ref<const Positions>& rest,
                               const ConstraintSet& constraints,
                               absl::Span<const HandlePose> poses) {
  std::vector<Eigen::Matrix3d> linear_parts;
  for (const HandlePose& pose : poses) {
    linear_parts.push_back(pose.scale * RotationMatrix(pose.rotation_vector));
  }
  Positions positions = rest(constraints.constrained(), Eigen::all);
  for (Eigen::Index c = 0; c < positions.rows(); ++c) {
    const int handle = constraints.region_of_constrained()[c];
    if (handle != ConstraintSet::kFixed) {
      const HandlePose& pose = poses[handle];
      const Eigen::Vector3d position = positions.row(c);
      positions.row(c) =
          pose.pivot_mm + linear_parts[handle] * (position - pose.pivot_mm) + pose.translation_mm;
    }
  }
  return positions;
}

HandleTargets MakeHandleTargets(const ConstraintSet& constraints,
                                const Eigen::Ref<const Positions>& rest,
                                absl::Span<const HandlePose> poses) {
  HandleTargets targets{ConstrainedPositions(rest, constraints, poses), {}, {}};
  targets.displacements = targets.positions - rest(constraints.constrained(), Eigen::all);
  targets.resting_gaps.resize(static_cast<Eigen::Index>(constraints.contact().size()));
  for (Eigen::Index r = 0; r < targets.resting_gaps.size(); ++r) {
    const ContactRow& row = constraints.contact()[static_cast<size_t>(r)];
    targets.resting_gaps[r] = row.gap_mm;
    if (row.handle == ContactRow::kFixedBone) continue;
    const Eigen::Vector3d place = rest.row(row.vertex);
    targets.resting_gaps[r] -=
        row.normal.dot(ApplyPose(poses[static_cast<size_t>(row.handle)], place) - place);
  }
  return targets;
}

Positions ToPositions(const ConstraintSet& constraints, const Eigen::Ref<const Positions>& rest,
                      const Eigen::MatrixXd& displacements, const HandleTargets& targets) {
  Positions positions = rest + displacements;
  positions(constraints.constrained(), Eigen::all) = targets.positions;
  return positions;
}

}  // namespace tissueform
