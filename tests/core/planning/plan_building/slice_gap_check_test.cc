// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/slice_gap_check.h"

#include <cmath>

#include "gtest/gtest.h"

namespace tissueform {
namespace {

// A block of tissue from x, y, z = 0 to 20 mm, of which what lies over z = 4 is planned.
SoftTissue Block() {
  SoftTissue tissue;
  tissue.labels = LabelGrid({.size = {21, 21, 21}, .spacing_mm = 1}, kSoftTissue);
  tissue.region.back = {{0, 100, 0}, -Eigen::Vector3d::UnitY()};
  tissue.region.above = {{0, 0, 100}, -Eigen::Vector3d::UnitZ()};
  tissue.region.below = {{0, 0, 4}, Eigen::Vector3d::UnitZ()};
  return tissue;
}

SliceGap Gap(double from_mm, double to_mm, double largest_mm) {
  return {Eigen::Vector3d::UnitZ(), from_mm, to_mm, largest_mm};
}

TEST(SliceGapCheckTest, GapsOutsideTheRegionDoNotCount) {
  EXPECT_FALSE(WidestGapInRegion({}, Block()).has_value());
  EXPECT_FALSE(WidestGapInRegion({Gap(-10, 3.5, 7), Gap(20.5, 90, 7)}, Block()).has_value());
}

TEST(SliceGapCheckTest, WidestOfTheRegionIsFound) {
  const auto widest = WidestGapInRegion(
      {Gap(-10, 3.5, 9), Gap(4.5, 10, 5.5), Gap(12, 19, 7), Gap(20.5, 90, 8)}, Block());
  ASSERT_TRUE(widest.has_value());
  EXPECT_EQ(widest->largest_mm, 7);
}

TEST(SliceGapCheckTest, GapOfLeaningSlicesIsAlongTheirNormal) {
  const Eigen::Vector3d normal(0, -std::sin(0.3), std::cos(0.3));
  // Over the highest corner of the block, (y, z) = (0, 20), and just under it.
  const double highest = 20 * std::cos(0.3);
  EXPECT_FALSE(WidestGapInRegion({{normal, highest + 0.1, 50, 7}}, Block()).has_value());
  EXPECT_TRUE(WidestGapInRegion({{normal, highest - 0.1, 50, 7}}, Block()).has_value());
}

TEST(SliceGapCheckTest, IgnoresGapsInAir) {
  SoftTissue tissue = Block();
  for (int y = 0; y < 21; ++y) {
    for (int x = 0; x < 21; ++x) {
      for (int z = 12; z < 21; ++z) tissue.labels.At(x, y, z) = 0;
    }
  }
  EXPECT_FALSE(WidestGapInRegion({Gap(11.5, 19, 7)}, tissue).has_value());
  EXPECT_TRUE(WidestGapInRegion({Gap(10.5, 19, 7)}, tissue).has_value());
}

}  // namespace
}  // namespace tissueform
