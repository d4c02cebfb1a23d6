// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/plane.h"

#include <cmath>
#include <numbers>

#include "gtest/gtest.h"
#include <Eigen/Geometry>

#include "core/imaging/anatomy/grid_operations.h"

namespace tissueform {
namespace {

// A body without other symmetries than that in its own x = 0, moved by `pose`.
LabelGrid SymmetricBody(const Eigen::Isometry3d& pose) {
  GridGeometry geometry;
  geometry.size = {60, 60, 60};
  geometry.spacing_mm = 2;
  geometry.origin_mm = Eigen::Vector3d::Constant(-59);
  const LabelGrid all(geometry, 1);
  LabelGrid body(geometry);
  ForEachVoxel(all, [&](size_t index, const Eigen::Vector3d& place) {
    const Eigen::Vector3d p = pose.inverse() * place;
    const double side = std::abs(p.x());
    const bool wedge = side < 30 + 0.3 * p.y() && std::abs(p.y()) < 30 && std::abs(p.z()) < 8;
    const bool horn =
        std::abs(side - 20) < 5 && std::abs(p.y() - 10) < 8 && p.z() > 0 && p.z() < 35;
    body.values[index] = wedge || horn ? 1 : 0;
  });
  return body;
}

TEST(SymmetryPlaneTest, AMovedBodysPlaneIsFound) {
  const double degree = std::numbers::pi / 180;
  for (const double sign : {-1.0, 1.0}) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translate(Eigen::Vector3d(sign * 4, 0, 0));
    pose.rotate(Eigen::AngleAxisd(sign * 6 * degree, Eigen::Vector3d::UnitZ()));
    pose.rotate(Eigen::AngleAxisd(-sign * 4 * degree, Eigen::Vector3d::UnitY()));
    const Plane plane = FindSymmetryPlane(SymmetricBody(pose), 0);
    const Eigen::Vector3d normal = pose.linear() * Eigen::Vector3d::UnitX();
    EXPECT_GT(plane.normal.dot(normal), std::cos(1.0 * degree));
    EXPECT_NEAR(plane.HeightMm(pose.translation()), 0, 0.7);
  }
}

}  // namespace
}  // namespace tissueform
