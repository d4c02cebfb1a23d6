// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/outer_skin.h"

#include <cmath>

#include "core/imaging/anatomy/grid_operations.h"
#include "tests/core/imaging/anatomy/head_phantom.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using testing::HeadPhantom;

class OuterSkinTest : public ::testing::Test {
 protected:
  void SetUp() override {
    HuGrid ct = HeadPhantom();
    Carve(&ct);
    ASSERT_OK_AND_ASSIGN(head_, SegmentHead(ct));
    outside_ = OutsideAir(head_);
  }

  static bool IsNear(const Eigen::Vector3d& place, const Eigen::Vector3d& axis, double mm) {
    return std::hypot(place.x() - axis.x(), place.y() - axis.y()) < mm;
  }

  // Two nostrils of 8 mm from below into the nose, up to its middle; a windpipe of 20 mm that the
  // lower border of the CT cuts; a groove of 4 mm, 4 mm deep, in the chin's skin.
  static void Carve(HuGrid* ct) {
    ForEachVoxel(LabelGrid(ct->geometry, 1), [&](size_t index, const Eigen::Vector3d& p) {
      const bool nostril =
          (IsNear(p, {6, -84, 0}, 4) || IsNear(p, {-6, -84, 0}, 4)) && p.z() < 4 && p.z() > -40;
      const bool windpipe = IsNear(p, {0, 10, 0}, 10) && p.z() < -60;
      const bool groove = std::abs(p.z() + 68) < 2 && p.y() < -72 && p.y() > -110;
      if (nostril || windpipe || groove) ct->values[index] = -1000;
    });
  }

  bool IsOutside(const Eigen::Vector3d& place) const {
    const Eigen::Vector3d at = outside_.geometry.ToVoxels(place).array().round();
    return outside_.At(static_cast<int>(at.x()), static_cast<int>(at.y()),
                       static_cast<int>(at.z())) != 0;
  }

  HeadSegmentation head_;
  LabelGrid outside_;
};

TEST_F(OuterSkinTest, AirAboutTheHeadIsOutsideAndAirInItIsNot) {
  EXPECT_TRUE(IsOutside({60, -70, -20})) << "beside the nose";
  EXPECT_TRUE(IsOutside({1, -99, 1})) << "before the nose";
  EXPECT_FALSE(IsOutside({6, -84, 3})) << "end of a nostril";
  EXPECT_FALSE(IsOutside({1, -40, -12})) << "nasal cavity";
  EXPECT_FALSE(IsOutside({1, 10, -100})) << "windpipe";
  EXPECT_FALSE(IsOutside({1, -50, -44})) << "behind the lips";
}

TEST_F(OuterSkinTest, ItReachesIntoCreases) {
  EXPECT_TRUE(IsOutside({1, -73, -68})) << "bottom of the groove";
}

TEST_F(OuterSkinTest, NoTissueIsAir) {
  for (size_t i = 0; i < outside_.values.size(); ++i) {
    ASSERT_TRUE(outside_.values[i] == 0 || head_.hu.values[i] <= head_.options.tissue_above_hu);
  }
}

TEST(VoxelsFacingTest, AreThoseWithAFaceOnTheAir) {
  LabelGrid air({.size = {5, 5, 5}, .spacing_mm = 2});
  LabelGrid mask(air.geometry, 1);
  air.At(2, 2, 2) = 1;
  mask.At(2, 2, 2) = 0;
  mask.At(2, 2, 3) = 0;
  const LabelGrid facing = VoxelsFacing(air, mask);
  EXPECT_EQ(CountVoxels(facing), 5);
  EXPECT_EQ(facing.At(1, 2, 2), 1);
  EXPECT_EQ(facing.At(1, 1, 2), 0);
  EXPECT_EQ(facing.At(2, 2, 3), 0);
}

// A wall with a hole far to one side: the way leads round it.
TEST(DistanceWithinTest, GoesRoundWalls) {
  LabelGrid mask({.size = {9, 9, 3}, .spacing_mm = 2}, 1);
  for (int y = 0; y < 8; ++y) {
    for (int z = 0; z < 3; ++z) mask.At(4, y, z) = 0;
  }
  LabelGrid seeds(mask.geometry);
  seeds.At(3, 4, 1) = 1;
  const VoxelGrid<float> distance = DistanceWithin(mask, seeds, 100);
  EXPECT_EQ(distance.At(3, 4, 1), 0);
  EXPECT_FLOAT_EQ(distance.At(3, 7, 1), 6);
  EXPECT_FLOAT_EQ(distance.At(2, 5, 2), 2 * std::sqrt(3.0F));
  EXPECT_TRUE(std::isinf(distance.At(4, 4, 1)));
  // Down to the hole at y = 8, through it and up again: the wall's corners cannot be cut.
  EXPECT_FLOAT_EQ(distance.At(5, 4, 1), 2 * (4 + 2 + 4));
  EXPECT_TRUE(std::isinf(DistanceWithin(mask, seeds, 10).At(5, 4, 1)));
}

}  // namespace
}  // namespace tissueform
