// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/closest_rotation.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>

namespace tissueform {

Eigen::Matrix3d ClosestRotation(const Eigen::Matrix3d& F) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(F, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d U = svd.matrixU();
  const Eigen::Matrix3d& V = svd.matrixV();
  if ((U * V.transpose()).determinant() < 0) {
    U.col(2) *= -1;  // the smallest singular value gives way
  }
  return U * V.transpose();
}

Eigen::Matrix3d RotationPower(const Eigen::Matrix3d& R, double exponent) {
  // Eigen goes through a quaternion, so the axis is found at half a turn, too, where the skew part
  // vanishes: the case for which the batch function hands over.
  const Eigen::AngleAxisd rotation(R);
  return Eigen::AngleAxisd(exponent * rotation.angle(), rotation.axis()).toRotationMatrix();
}

}  // namespace tissueform
