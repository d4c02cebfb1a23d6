// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/generation/surface_distance.h"

#include <random>

#include "gtest/gtest.h"

#include "tests/core/mesh/generation/surfaces.h"

namespace tissueform {
namespace {

TEST(SurfaceDistanceTest, DistanceToABoxIsThatOfItsFormula) {
  const TriangleMesh box = testing::BoxSurface({-1, -2, -3}, {1, 2, 3}, 4);
  std::mt19937 generator(2);
  Positions points(2000, 3);
  for (double& c : points.reshaped()) c = 10 * (generator() / 4294967295.0) - 5;
  const Eigen::VectorXd distances = DistancesToSurface(points, box);
  for (Eigen::Index p = 0; p < points.rows(); ++p) {
    const Eigen::RowVector3d beyond =
        points.row(p).cwiseAbs() - Eigen::RowVector3d(1, 2, 3);  // negative inside
    const double expected = beyond.maxCoeff() < 0 ? -beyond.maxCoeff() : beyond.cwiseMax(0).norm();
    EXPECT_NEAR(distances[p], expected, 1e-9);
  }
  EXPECT_EQ(DistancesToSurface(points, box, 3), distances);
}

TEST(SurfaceDistanceTest, VerticesLieOnTheirSurface) {
  const TriangleMesh sphere = testing::SphereSurface({1, 2, 3}, 5, 6);
  EXPECT_LT(DistancesToSurface(sphere.positions(), sphere).maxCoeff(), 1e-9);
}

}  // namespace
}  // namespace tissueform
