// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/outcome/skin_profile.h"

#include <utility>
#include <vector>

#include "gtest/gtest.h"

namespace tissueform {
namespace {

// A sheet whose outline in the plane x = 0 has these corners, (y, z) in LPS from below to above.
std::pair<Positions, TriangleIndices> Sheet(const std::vector<std::pair<double, double>>& outline) {
  const auto count = static_cast<Eigen::Index>(outline.size());
  Positions positions(2 * count, 3);
  TriangleIndices triangles(2 * (count - 1), 3);
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto& [y, z] = outline[static_cast<size_t>(i)];
    positions.row(2 * i) << -5, y, z;
    positions.row(2 * i + 1) << 5, y, z;
  }
  for (int32_t i = 0; i + 1 < static_cast<int32_t>(count); ++i) {
    triangles.row(2 * i) << 2 * i, 2 * i + 1, 2 * i + 2;
    triangles.row(2 * i + 1) << 2 * i + 1, 2 * i + 3, 2 * i + 2;
  }
  return {positions, triangles};
}

// Chin at (-20, 0), a fold at (-14, 10), a lip at (-22, 20).
const std::vector<std::pair<double, double>> kFace = {
    {-10, -10}, {-20, 0}, {-14, 10}, {-22, 20}, {-18, 30}};

TEST(SkinProfileTest, FindsChinFoldAndLip) {
  const auto [positions, triangles] = Sheet(kFace);
  const SkinProfile profile(positions, triangles, HeadFrame());
  EXPECT_LT((*profile.Foremost(-5, 5) - Eigen::Vector3d(0, -20, 0)).norm(), 1e-9);
  EXPECT_LT((*profile.Foremost(25, 15) - Eigen::Vector3d(0, -22, 20)).norm(), 1e-9);
  EXPECT_LT((*profile.Deepest(0, 20) - Eigen::Vector3d(0, -14, 10)).norm(), 1e-9);
}

TEST(SkinProfileTest, AStraightPieceHasNoFold) {
  const auto [positions, triangles] = Sheet(kFace);
  const SkinProfile profile(positions, triangles, HeadFrame());
  EXPECT_FALSE(profile.Deepest(11, 19).has_value());
  EXPECT_FALSE(profile.Foremost(40, 50).has_value());
}

TEST(SkinProfileTest, FollowsTheHeadFrameWhereTheHeadIsTurned) {
  const auto [positions, triangles] = Sheet(kFace);
  HeadFrame turned;
  turned.origin_mm = {3, 4, 5};
  turned.left = Eigen::Vector3d::UnitY();
  turned.posterior = -Eigen::Vector3d::UnitX();
  const Positions moved =
      (positions * turned.ToLps().transpose()).rowwise() + turned.origin_mm.transpose();
  const SkinProfile profile(moved, triangles, turned);
  const Eigen::Vector3d fold = *profile.Deepest(0, 20);
  EXPECT_NEAR(profile.FrontOf(fold), 14, 1e-9);
  EXPECT_NEAR(profile.HeightOf(fold), 10, 1e-9);
}

}  // namespace
}  // namespace tissueform
