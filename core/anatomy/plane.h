// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <Eigen/Core>

namespace tissueform {

// All points p with (p - point_mm) . normal = 0. `normal` has length 1 and points to the side that
// is meant where one is.
struct Plane {
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();

  // How far p lies on the side of the normal, in mm; negative on the other.
  double HeightMm(const Eigen::Vector3d& p) const { return normal.dot(p - point_mm); }
};

}  // namespace tissueform
