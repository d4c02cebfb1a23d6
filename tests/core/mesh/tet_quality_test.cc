// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/tet_quality.h"

#include <cmath>
#include <numbers>

#include "gtest/gtest.h"

#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

TEST(TetQualityTest, RegularTetHasItsKnownAngleAndVolume) {
  Positions positions(4, 3);
  positions << 1, 1, 1, -1, 1, -1, 1, -1, -1, -1, -1, 1;
  TetIndices tets(1, 4);
  tets << 0, 1, 2, 3;
  const double angle = std::acos(1.0 / 3.0) * 180.0 / std::numbers::pi;
  const auto angles = DihedralAnglesDeg(positions, tets);
  EXPECT_NEAR(angles.minCoeff(), angle, 1e-12);
  EXPECT_NEAR(angles.maxCoeff(), angle, 1e-12);
  EXPECT_NEAR(std::abs(TetVolumes(positions, tets)[0]), 8.0 / 3.0, 1e-15);
}

TEST(TetQualityTest, SwappingTwoVerticesTurnsTheSign) {
  const TetMesh tet = testing::SingleTet();
  TetIndices swapped = tet.tets();
  std::swap(swapped(0, 0), swapped(0, 1));
  const double volume = TetVolumes(tet.positions(), tet.tets())[0];
  EXPECT_GT(volume, 0);
  EXPECT_DOUBLE_EQ(TetVolumes(tet.positions(), swapped)[0], -volume);
}

// Figures from the tongue's SOURCE.md, found with another program.
TEST(TetQualityTest, TongueHasThePublishedAngles) {
  const TetQualitySummary summary =
      SummarizeTetQuality(testing::LoadTestMesh("meshes/tet_sofa_tongue/volumetricTongue.vtu"));
  EXPECT_NEAR(summary.min_dihedral_deg, 1.004, 0.0005);
  EXPECT_NEAR(summary.max_dihedral_deg, 178.485, 0.0005);
  EXPECT_EQ(summary.tets_below_10_deg, 105);
  EXPECT_EQ(summary.tets_below_5_deg, 34);
  EXPECT_GT(summary.min_volume_mm3, 0);
}

}  // namespace
}  // namespace tissueform
