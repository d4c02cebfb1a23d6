// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/problem/plan_problem.h"

#include "gtest/gtest.h"

#include "core/mesh/tet_quality.h"
#include "tests/testing/meshes.h"

namespace tissueform {
namespace {

using testing::Bar;

TEST(CoordinatesTest, PoseInRasMovesAPointAsItsTwinInLpsDoes) {
  const HandlePose ras{.rotation_vector = {0.3, -1.2, 2.0},
                       .pivot_mm = {1, 2, 3},
                       .translation_mm = {-4, 5, 6},
                       .scale = 1.5};
  const Eigen::Vector3d signs(-1, -1, 1);
  const Eigen::Vector3d point(7, -8, 9);
  const Eigen::Vector3d in_lps =
      ApplyPose(SwapToOrFromLps(CoordinateSystem::kRas, ras), signs.cwiseProduct(point));
  EXPECT_TRUE(signs.cwiseProduct(in_lps).isApprox(ApplyPose(ras, point), 1e-14));
}

TEST(CoordinatesTest, SwappingTwiceChangesNothing) {
  Positions positions = Bar({1, 1, 1}).positions();
  const Positions before = positions;
  SwapToOrFromLps(CoordinateSystem::kRas, &positions);
  EXPECT_NE(positions, before);
  SwapToOrFromLps(CoordinateSystem::kRas, &positions);
  EXPECT_EQ(positions, before);
}

TEST(CoordinatesTest, TetsStayPositive) {
  const TetMesh bar = Bar({2, 1, 1});
  Positions positions = bar.positions();
  SwapToOrFromLps(CoordinateSystem::kRas, &positions);
  EXPECT_EQ(TetVolumes(positions, bar.tets()), TetVolumes(bar.positions(), bar.tets()));
}

}  // namespace
}  // namespace tissueform
