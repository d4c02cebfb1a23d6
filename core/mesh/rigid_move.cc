// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/rigid_move.h"

#include <numbers>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>

namespace tissueform {

RigidMove Composed(const RigidMove& second, const RigidMove& first) {
  return {second.rotation * first.rotation, second(first.translation_mm)};
}

RigidMove Inverse(const RigidMove& move) {
  return {move.rotation.transpose(), -(move.rotation.transpose() * move.translation_mm)};
}

Positions Moved(const Positions& points, const RigidMove& move) {
  return (points * move.rotation.transpose()).rowwise() + move.translation_mm.transpose();
}

double TurnDegrees(const RigidMove& move) {
  return Eigen::AngleAxisd(move.rotation).angle() * 180 / std::numbers::pi;
}

Eigen::Matrix3d NearestRotation(const Eigen::Matrix3d& matrix) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs = Eigen::Vector3d::Ones();
  signs[2] = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  return svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
}

RigidMove MoveOnto(const Positions& from, const Positions& to, const Eigen::VectorXd& weights) {
  const double sum = weights.sum();
  const Eigen::RowVector3d from_center = weights.transpose() * from / sum;
  const Eigen::RowVector3d to_center = weights.transpose() * to / sum;
  const Eigen::Matrix3d spread = (to.rowwise() - to_center).transpose() * weights.asDiagonal() *
                                 (from.rowwise() - from_center);
  RigidMove move;
  move.rotation = NearestRotation(spread);
  move.translation_mm = to_center.transpose() - move.rotation * from_center.transpose();
  return move;
}

}  // namespace tissueform
