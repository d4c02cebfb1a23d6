// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/orientation.h"

#include <limits>

#include "gtest/gtest.h"

#include "core/mesh/tet_quality.h"
#include "tests/testing/meshes.h"

namespace tissueform {
namespace {

TetIndices Turned(TetIndices tets) {
  tets.col(0).swap(tets.col(1));
  return tets;
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
