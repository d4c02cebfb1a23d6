// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/tet_quality.h"

#include <cmath>
#include <limits>
#include <numbers>

#include "gtest/gtest.h"

#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

TetIndices Turned(TetIndices tets) {
  tets.col(0).swap(tets.col(1));
  return tets;
}

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

TEST(OrientationTest, MeshOfNegativeTetsBecomesPositiveWithTheSameVolumes) {
  const TetMesh bar = testing::Bar({2, 2, 2}, 1.0, 0.2);
  TetIndices tets = Turned(bar.tets());
  EXPECT_EQ(RepairOrientation(bar.positions(), &tets), bar.num_tets());
  EXPECT_TRUE(
      TetVolumes(bar.positions(), tets).isApprox(TetVolumes(bar.positions(), bar.tets()), 1e-12));
}

TEST(OrientationTest, PositiveMeshIsNotTouched) {
  const TetMesh bar = testing::Bar({2, 2, 2});
  TetIndices tets = bar.tets();
  EXPECT_EQ(RepairOrientation(bar.positions(), &tets), 0);
  EXPECT_EQ(tets, bar.tets());
}

TEST(OrientationTest, SingleTetsOfEitherSignAreLeftForValidation) {
  const TetMesh bar = testing::Bar({2, 2, 2});
  TetIndices one_negative = bar.tets();
  std::swap(one_negative(5, 0), one_negative(5, 1));
  TetIndices one_positive = Turned(one_negative);
  for (const TetIndices& given : {one_negative, one_positive}) {
    TetIndices tets = given;
    EXPECT_EQ(RepairOrientation(bar.positions(), &tets), 0);
    EXPECT_EQ(tets, given);
  }
}

TEST(OrientationTest, FlatOrNonFiniteMeshIsNotTouched) {
  const TetMesh tet = testing::SingleTet();
  TetIndices tets = Turned(tet.tets());
  const TetIndices given = tets;
  Positions flat = tet.positions();
  flat.col(2).setZero();
  EXPECT_EQ(RepairOrientation(flat, &tets), 0);
  Positions infinite = tet.positions();
  infinite(0, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(RepairOrientation(infinite, &tets), 0);
  EXPECT_EQ(tets, given);
}

}  // namespace
}  // namespace tissueform
