// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/head_segmentation.h"

#include "tests/core/imaging/anatomy/head_phantom.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using testing::AtPlaceOf;
using testing::DiceOverlap;
using ::testing::HasSubstr;
using testing::HeadPhantom;
using testing::HeadPhantomMask;
using testing::HeadPhantomOptions;
using testing::HeadPhantomParts;
using testing::StatusIs;

using ::tissueform::testing::kInvalid;

TEST(HeadSegmentationTest, HeadAndBoneOfThePhantomAreFound) {
  ASSERT_OK_AND_ASSIGN(const HeadSegmentation head, SegmentHead(HeadPhantom()));
  const GridGeometry& geometry = head.head.geometry;
  EXPECT_GT(DiceOverlap(head.head, AtPlaceOf(geometry, HeadPhantomMask())), 0.998);
  EXPECT_GT(DiceOverlap(head.bone, AtPlaceOf(geometry, HeadPhantomParts())), 0.999);
  EXPECT_LT(head.bare_fraction, 0.1);
}

TEST(HeadSegmentationTest, ACordIsReplacedByAir) {
  HeadPhantomOptions options;
  options.with_cord = true;
  const HuGrid ct = HeadPhantom(options);
  ASSERT_OK_AND_ASSIGN(const HeadSegmentation head, SegmentHead(ct));
  const LabelGrid truth = AtPlaceOf(head.head.geometry, HeadPhantomMask(options));
  EXPECT_GT(DiceOverlap(head.head, truth), 0.998);
  const Eigen::Vector3d in_cord = head.hu.geometry.ToVoxels({12, -84, -100});
  const auto x = static_cast<int>(in_cord.x() + 0.5);
  const auto y = static_cast<int>(in_cord.y() + 0.5);
  const auto z = static_cast<int>(in_cord.z() + 0.5);
  ASSERT_TRUE(head.hu.geometry.Contains(x, y, z));
  EXPECT_EQ(head.hu.At(x, y, z), -1000);
  EXPECT_GT(head.removed_mm3, 500);
}

TEST(HeadSegmentationTest, ASkullWithoutSkinIsRefused) {
  HeadPhantomOptions options;
  options.with_soft_tissue = false;
  EXPECT_THAT(SegmentHead(HeadPhantom(options)),
              StatusIs(kInvalid, AllOf(HasSubstr("no skin"), HasSubstr("a bare skull"))));
}

TEST(HeadSegmentationTest, BoneThatLiesBareOnASolidIsRefused) {
  GridGeometry geometry;
  geometry.size = {80, 80, 80};
  geometry.spacing_mm = 2;
  HuGrid ct(geometry, -1000);
  const LabelGrid all(geometry, 1);
  const Eigen::Vector3d middle(80, 80, 80);
  ForEachVoxel(all, [&](size_t index, const Eigen::Vector3d& place) {
    const double radius = (place - middle).norm();
    if (radius < 60) ct.values[index] = radius < 52 ? 40 : 700;
  });
  EXPECT_THAT(SegmentHead(ct),
              StatusIs(kInvalid, HasSubstr("no skin: 100 % of the outer surface")));
}

TEST(HeadSegmentationTest, ValuesThatAreNotOfAHeadAreRefused) {
  GridGeometry geometry;
  geometry.size = {60, 60, 60};
  geometry.spacing_mm = 2;
  EXPECT_THAT(
      SegmentHead(HuGrid(geometry, -1000)),
      StatusIs(kInvalid, AllOf(HasSubstr("0 cm3"), HasSubstr("check that the values are HU"))));
  EXPECT_THAT(SegmentHead(HuGrid(geometry, 40)), StatusIs(kInvalid, HasSubstr("above 250 HU")));
}

TEST(HeadSegmentationTest, ReportsStagesInOrder) {
  std::vector<double> fractions;
  const auto on_stage = [&](absl::string_view, double fraction) { fractions.push_back(fraction); };
  ASSERT_TRUE(SegmentHead(HeadPhantom(), {}, on_stage).ok());
  EXPECT_GE(fractions.size(), 2U);
  EXPECT_TRUE(std::is_sorted(fractions.begin(), fractions.end()));
}

}  // namespace
}  // namespace tissueform
