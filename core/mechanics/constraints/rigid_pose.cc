// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/constraints/rigid_pose.h"

#include <Eigen/Geometry>

namespace tissueform {

HandlePose PoseOf(const RigidMove& move, const Eigen::Vector3d& pivot_mm) {
  const Eigen::AngleAxisd turn(move.rotation);
  HandlePose pose;
  pose.rotation_vector = turn.angle() * turn.axis();
  pose.pivot_mm = pivot_mm;
  pose.translation_mm = move(pivot_mm) - pivot_mm;
  return pose;
}

RigidMove MoveOf(const HandlePose& pose) {
  return {RotationMatrix(pose.rotation_vector), ApplyPose(pose, Eigen::Vector3d::Zero())};
}

}  // namespace tissueform
