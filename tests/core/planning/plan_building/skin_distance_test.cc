// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/skin_distance.h"

#include <cmath>
#include <utility>

#include "gtest/gtest.h"

namespace tissueform {
namespace {

// CT numbers that fall with the height: 50 HU a mm, 0 HU at z = 10 mm. Voxels of 2 mm.
HuGrid Ramp() {
  GridGeometry geometry;
  geometry.size = {12, 12, 12};
  geometry.spacing_mm = 2;
  HuGrid hu(geometry);
  for (int z = 0; z < 12; ++z) {
    for (int y = 0; y < 12; ++y) {
      for (int x = 0; x < 12; ++x) {
        hu.At(x, y, z) = static_cast<int16_t>(50 * (10 - 2 * z));
      }
    }
  }
  return hu;
}

// Four vertices at that height in the middle, facing up.
TriangleMesh SquareAt(double height_mm) {
  Positions positions(4, 3);
  positions << 8, 8, height_mm, 14, 8, height_mm, 14, 14, height_mm, 8, 14, height_mm;
  TriangleIndices triangles(2, 3);
  triangles << 0, 1, 2, 0, 2, 3;
  return *TriangleMesh::Create(std::move(positions), std::move(triangles));
}

TEST(SkinDistanceTest, DistanceFromAPlaneIsExactOnBothSides) {
  for (const double off : {-3.1, -0.25, 0.0, 0.4, 2.9}) {
    const SkinDistance distance =
        MeasureSkinDistance(SquareAt(10 + off), {true, true, true, true}, Ramp(), 0);
    ASSERT_EQ(distance.mm.size(), 4U) << off;
    EXPECT_NEAR(distance.mean_mm, std::abs(off), 1e-9);
    EXPECT_NEAR(distance.p99_mm, std::abs(off), 1e-9);
    EXPECT_NEAR(distance.max_mm, std::abs(off), 1e-9);
    EXPECT_EQ(distance.not_found, 0);
  }
}

TEST(SkinDistanceTest, OtherThresholdsLieElsewhere) {
  const SkinDistance distance =
      MeasureSkinDistance(SquareAt(10), {true, true, true, true}, Ramp(), 100);
  EXPECT_NEAR(distance.mean_mm, 2, 1e-9);
}

TEST(SkinDistanceTest, MeasuresOnlySkinAndCountsVerticesTooFarAway) {
  const SkinDistance part =
      MeasureSkinDistance(SquareAt(11), {false, true, false, false}, Ramp(), 0);
  EXPECT_EQ(part.mm.size(), 1U);
  const SkinDistance far = MeasureSkinDistance(SquareAt(10), {true, true, true, true}, Ramp(), 600);
  EXPECT_EQ(far.mm.size(), 0U);
  EXPECT_EQ(far.not_found, 4);
  EXPECT_EQ(far.mean_mm, 0);
}

}  // namespace
}  // namespace tissueform
