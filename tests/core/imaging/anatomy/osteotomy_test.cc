// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/osteotomy.h"

#include <algorithm>
#include <cmath>

#include "core/imaging/anatomy/bone_parts.h"
#include "tests/core/imaging/anatomy/head_phantom.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::HeadPhantom;
using testing::StatusIs;

using ::tissueform::testing::kInvalid;

class OsteotomyTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_OK_AND_ASSIGN(head_, SegmentHead(HeadPhantom()));
    ASSERT_OK_AND_ASSIGN(parts_, SeparateBoneParts(head_));
    ASSERT_OK_AND_ASSIGN(landmarks_, FindLandmarks(head_, parts_));
  }

  OsteotomySegment Default(OsteotomyKind kind) const {
    return DefaultSegment(kind, OsteotomyKindName(kind), landmarks_);
  }
  absl::StatusOr<LabelGrid> Cut(const std::vector<OsteotomySegment>& segments) const {
    return CutSegments(parts_.labels, segments);
  }
  uint8_t LabelAt(const LabelGrid& labels, const Eigen::Vector3d& place) const {
    const Eigen::Vector3d p = labels.geometry.ToVoxels(place);
    return labels.At(static_cast<int>(std::lround(p.x())), static_cast<int>(std::lround(p.y())),
                     static_cast<int>(std::lround(p.z())));
  }

  HeadSegmentation head_;
  BoneParts parts_;
  Landmarks landmarks_;
};

TEST_F(OsteotomyTest, SagittalSplitMovesTeethAndChinAndLeavesTheRami) {
  ASSERT_OK_AND_ASSIGN(const LabelGrid labels, Cut({Default(OsteotomyKind::kBssro)}));
  for (const double side : {-1.0, 1.0}) {
    EXPECT_EQ(LabelAt(labels, {side * 1, -59, -50}), 2) << "front teeth";
    EXPECT_EQ(LabelAt(labels, {side * 28, -37.6, -50}), 2) << "molars";
    EXPECT_EQ(LabelAt(labels, {side * 1, -59, -80}), 2) << "chin";
    EXPECT_EQ(LabelAt(labels, {side * 45, 11, -24}), 1) << "condyle";
    EXPECT_EQ(LabelAt(labels, {side * 45, -6, -31}), 1) << "coronoid";
    EXPECT_EQ(LabelAt(labels, {side * 45, 12, -70}), 1) << "angle";
  }
  EXPECT_EQ(LabelAt(labels, {1, -59, -35}), 1) << "upper teeth";
  EXPECT_EQ(LabelAt(labels, {1, 45, -60}), 1) << "spine";
}

TEST_F(OsteotomyTest, LeFort1MovesTheUpperTeethAndThePalateOnly) {
  ASSERT_OK_AND_ASSIGN(const LabelGrid labels, Cut({Default(OsteotomyKind::kLeFort1)}));
  EXPECT_EQ(LabelAt(labels, {1, -59, -35}), 2) << "upper teeth";
  EXPECT_EQ(LabelAt(labels, {1, -40, -20}), 2) << "palate";
  EXPECT_EQ(LabelAt(labels, {27, -30, -6}), 1) << "wall over the cut";
  EXPECT_EQ(LabelAt(labels, {1, -59, -50}), 1) << "lower teeth";
}

TEST_F(OsteotomyTest, GenioplastyMovesTheChinUnderTheRoots) {
  ASSERT_OK_AND_ASSIGN(const LabelGrid labels, Cut({Default(OsteotomyKind::kGenioplasty)}));
  EXPECT_EQ(LabelAt(labels, {1, -59, -83}), 2);
  EXPECT_EQ(LabelAt(labels, {1, -59, -65}), 1);
  // 0.3 of the height from -85 to -47.
  const double cut_mm = -85 + 0.3 * 38;
  EXPECT_EQ(LabelAt(labels, {1, -59, cut_mm - 3}), 2);
  EXPECT_EQ(LabelAt(labels, {1, -59, cut_mm + 3}), 1);
}

TEST_F(OsteotomyTest, LaterSegmentsAreCutOutOfEarlierOnes) {
  ASSERT_OK_AND_ASSIGN(const LabelGrid labels,
                       Cut({Default(OsteotomyKind::kBssro), Default(OsteotomyKind::kLeFort1),
                            Default(OsteotomyKind::kGenioplasty)}));
  EXPECT_EQ(LabelAt(labels, {1, -59, -50}), 2);
  EXPECT_EQ(LabelAt(labels, {1, -59, -35}), 3);
  EXPECT_EQ(LabelAt(labels, {1, -59, -83}), 4);
  OsteotomySegment chin = Default(OsteotomyKind::kGenioplasty);
  chin.planes.push_back({{0, -50, 0}, -Eigen::Vector3d::UnitY()});
  EXPECT_THAT(Cut({chin, Default(OsteotomyKind::kBssro)}),
              StatusIs(kInvalid, AllOf(HasSubstr("\"genioplasty\" keeps 0 mm3"),
                                       HasSubstr("put it after those that cut it"))));
}

TEST_F(OsteotomyTest, BoneIsLabelledWhereItIsAndNowhereElse) {
  ASSERT_OK_AND_ASSIGN(const LabelGrid labels, Cut({Default(OsteotomyKind::kBssro)}));
  for (size_t i = 0; i < labels.values.size(); ++i) {
    ASSERT_EQ(labels.values[i] != 0, parts_.labels.values[i] != 0);
    ASSERT_TRUE(labels.values[i] != 2 || parts_.labels.values[i] == kMandible);
  }
  ASSERT_OK_AND_ASSIGN(const LabelGrid uncut, Cut({}));
  EXPECT_EQ(*std::max_element(uncut.values.begin(), uncut.values.end()), kFixedBone);
}

TEST_F(OsteotomyTest, PlanesThatMissTheBoneAreNamed) {
  OsteotomySegment segment = {"chin", OsteotomyKind::kGenioplasty, {}};
  segment.planes = {{{0, 0, -200}, -Eigen::Vector3d::UnitZ()}};
  EXPECT_THAT(Cut({segment}), StatusIs(kInvalid, AllOf(HasSubstr("segment \"chin\" has a plane 1"),
                                                       HasSubstr("misses the lower jaw"),
                                                       HasSubstr("on its negative side"))));
  segment.planes = {{{0, 0, -60}, -Eigen::Vector3d::UnitZ()},
                    {{0, 0, 200}, -Eigen::Vector3d::UnitZ()}};
  EXPECT_THAT(Cut({segment}),
              StatusIs(kInvalid, AllOf(HasSubstr("plane 2"), HasSubstr("on its positive side"))));
}

TEST_F(OsteotomyTest, SegmentsWithoutUsablePlanesAreRefused) {
  EXPECT_THAT(Cut({{"a", OsteotomyKind::kBssro, {}}}),
              StatusIs(kInvalid, HasSubstr("\"a\" has no plane")));
  EXPECT_THAT(Cut({{"a", OsteotomyKind::kBssro, {{{0, 0, -60}, {0, 0, 2}}}}}),
              StatusIs(kInvalid, HasSubstr("without a normal of length 1")));
  const Plane up = {{0, 0, -60}, Eigen::Vector3d::UnitZ()};
  const Plane down = {{0, 0, -61}, -Eigen::Vector3d::UnitZ()};
  EXPECT_THAT(Cut({{"a", OsteotomyKind::kBssro, {up, down}}}),
              StatusIs(kInvalid, HasSubstr("keeps 0 mm3")));
}

}  // namespace
}  // namespace tissueform
