// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/constraints/head_frame.h"

#include <cmath>

#include <Eigen/Geometry>

namespace tissueform {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kDegree = M_PI / 180;
// Of a frame's axes; files hold ten digits and more.
constexpr double kAxesTolerance = 1e-6;
// The cosine of a pitch below which roll and yaw cannot be separated: an error of so many radians.
constexpr double kGimbalCosine = 1e-7;

}  // namespace

Matrix3d HeadFrame::ToLps() const {
  Matrix3d axes;
  axes << left, posterior, superior;
  return axes;
}

absl::Status CheckHeadFrame(const HeadFrame& frame) {
  const Matrix3d axes = frame.ToLps();
  const bool is_rotation =
      (axes.transpose() * axes - Matrix3d::Identity()).norm() < kAxesTolerance &&
      axes.determinant() > 0;
  if (is_rotation && frame.origin_mm.allFinite()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      "head frame: left, posterior and superior are no unit vectors at right angles with superior "
      "= left x posterior; give three such axes");
}

Vector3d RotationVectorFromAngles(const HeadAngles& angles, const HeadFrame& frame) {
  const Matrix3d in_frame = (AngleAxisd(angles.yaw_deg * kDegree, Vector3d::UnitZ()) *
                             AngleAxisd(-angles.pitch_deg * kDegree, Vector3d::UnitX()) *
                             AngleAxisd(angles.roll_deg * kDegree, Vector3d::UnitY()))
                                .toRotationMatrix();
  const AngleAxisd turn(in_frame);
  return frame.ToLps() * (turn.axis() * turn.angle());
}

HeadAngles AnglesFromRotationVector(const Vector3d& rotation_vector, const HeadFrame& frame) {
  const Matrix3d R = RotationMatrix(frame.ToLps().transpose() * rotation_vector);
  const double cosine = std::hypot(R(0, 1), R(1, 1));
  HeadAngles angles;
  angles.pitch_deg = -std::atan2(R(2, 1), cosine) / kDegree;
  if (cosine < kGimbalCosine) {
    angles.roll_deg = std::atan2(R(0, 2), R(0, 0)) / kDegree;
  } else {
    angles.roll_deg = std::atan2(-R(2, 0), R(2, 2)) / kDegree;
    angles.yaw_deg = std::atan2(-R(0, 1), R(1, 1)) / kDegree;
  }
  return angles;
}

}  // namespace tissueform
