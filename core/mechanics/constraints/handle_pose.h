// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/status.h"
#include <Eigen/Core>

#include "core/base/types.h"

namespace tissueform {

// Where a handle goes: x = pivot + scale * exp([rotation_vector]) * (v - pivot) + translation.
//
// The rotation vector is axis times angle in radians and goes beyond a turn: 2 pi about x is a full
// twist, which the deformers distinguish from no rotation at all. That is why it is neither a
// quaternion nor a matrix.
struct HandlePose {
  Eigen::Vector3d rotation_vector = Eigen::Vector3d::Zero();  // radians
  Eigen::Vector3d pivot_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d translation_mm = Eigen::Vector3d::Zero();
  double scale = 1.0;
};

// exp([w]), the rotation by |w| about w. Accurate near zero.
Eigen::Matrix3d RotationMatrix(const Eigen::Vector3d& rotation_vector);

// InvalidArgument, naming the field: a number that is not finite, or too large; a scale <= 0.
absl::Status CheckPose(const HandlePose& pose);

Eigen::Vector3d ApplyPose(const HandlePose& pose, const Eigen::Vector3d& position);

// The one way between two poses that the load paths of the models, drags and trials go:
//
//   w(t) = (1 - t) w_a + t w_b, the same for pivot and translation;  s(t) = s_a^(1-t) s_b^t.
//
// So rotation and scale go at an even pace, both through their logarithm: about one pivot the
// linear part of the way from rest is exp(t (log(s) I + [w])). A full turn is walked through, not
// jumped over, and the scale is positive at every t, also beyond 1 (mixed linearly, 0.2 would be
// negative at t = 4/3). Exactly `a` at 0 and `b` at 1; a scale that both share stays to the last
// bit.
//
// REQUIRES: positive scales.
HandlePose PoseBetween(const HandlePose& a, const HandlePose& b, double t);

// Where a handle with this pose's pivot rests: nothing turned, scaled or moved.
HandlePose RestOf(const HandlePose& pose);

// The part `amount` of the way from rest to the pose; beyond 1 it goes farther. The pivot stays. A
// part of a part is the part of their product.
HandlePose PartOfPose(const HandlePose& pose, double amount);

}  // namespace tissueform
