// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/base/types.h"

namespace tissueform {

// x -> rotation x + translation_mm.
struct RigidMove {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation_mm = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator()(const Eigen::Vector3d& place) const {
    return rotation * place + translation_mm;
  }
};

// First `first`, then `second`.
RigidMove Composed(const RigidMove& second, const RigidMove& first);
RigidMove Inverse(const RigidMove& move);

// Points, #P by 3, where the movement takes them.
Positions Moved(const Positions& points, const RigidMove& move);

// The angle by which it turns, in degrees, at least 0.
double TurnDegrees(const RigidMove& move);

// The rotation nearest to a matrix.
Eigen::Matrix3d NearestRotation(const Eigen::Matrix3d& matrix);

// The best rigid movement of points onto points, row by row, each with a weight (#P, not negative,
// not all 0) (Kabsch 1976). REQUIRES: as many rows.
RigidMove MoveOnto(const Positions& from, const Positions& to, const Eigen::VectorXd& weights);

}  // namespace tissueform
