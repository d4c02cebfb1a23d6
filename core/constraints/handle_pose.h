// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/status.h"
#include <Eigen/Core>

#include "core/base/types.h"

namespace tissueform {

// Where a handle goes: x = pivot + scale * exp([rotation_vector]) * (v - pivot) + translation.
//
// The rotation vector is axis times angle in radians and is not bounded: 2 pi about x is a full
// twist, which the deformers tell from no rotation at all. That is why it is neither a quaternion
// nor a matrix.
struct HandlePose {
  Eigen::Vector3d rotation_vector = Eigen::Vector3d::Zero();  // radians
  Eigen::Vector3d pivot_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d translation_mm = Eigen::Vector3d::Zero();
  double scale = 1.0;
};

// exp([w]), the rotation by |w| about w. Accurate near zero.
Eigen::Matrix3d RotationMatrix(const Eigen::Vector3d& rotation_vector);

// InvalidArgument, naming the field, when a number is NaN or infinite or the scale is not positive.
absl::Status CheckPose(const HandlePose& pose);

Eigen::Vector3d ApplyPose(const HandlePose& pose, const Eigen::Vector3d& position);

}  // namespace tissueform
