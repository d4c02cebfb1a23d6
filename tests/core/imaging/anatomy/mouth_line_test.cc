// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/mouth_line.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::StatusIs;

// A flat face at `front` 60 with a groove 3 mm deep about the height up_of(left), as far out as
// `half_width_mm`.
template <typename UpOf>
FaceRelief GroovedFace(double half_width_mm, UpOf up_of) {
  FaceRelief relief;
  relief.right_mm = -35;
  relief.bottom_mm = -40;
  relief.front_mm = Eigen::ArrayXXd::Constant(121, 71, 60);
  for (Eigen::Index column = 0; column < 71; ++column) {
    const double left = relief.LeftOf(column);
    if (std::abs(left) > half_width_mm) continue;
    for (Eigen::Index row = 0; row < 121; ++row) {
      const double away = std::abs(relief.UpOf(row) - up_of(left));
      relief.front_mm(row, column) -= std::max(0.0, 3 - away);
    }
  }
  return relief;
}

TEST(MouthLineTest, FollowsABentNotchToItsCorners) {
  const auto up_of = [](double left) { return 5 - 0.005 * left * left; };
  ASSERT_OK_AND_ASSIGN(const MouthLine line, FindMouthLine(GroovedFace(24, up_of), 0));
  for (const MouthLinePoint& point : line.points) {
    EXPECT_NEAR(point.at.up, up_of(point.at.left), 0.5);
    EXPECT_NEAR(point.at.front, 57, 0.5);
  }
  EXPECT_NEAR(line.points.front().at.left, -24, 1);
  EXPECT_NEAR(line.points.back().at.left, 24, 1);
  EXPECT_EQ(line.left_corner, MouthCornerReason::kNotchEnds);
  EXPECT_EQ(line.right_corner, MouthCornerReason::kNotchEnds);
  EXPECT_TRUE(line.line_is_sure());
}

TEST(MouthLineTest, ANotchThatGoesOnIsCappedAndUnsure) {
  ASSERT_OK_AND_ASSIGN(const MouthLine line,
                       FindMouthLine(GroovedFace(35, [](double) { return 0; }), 0));
  EXPECT_EQ(line.points.back().at.left, kMouthHalfWidthCapMm);
  EXPECT_EQ(line.left_corner, MouthCornerReason::kCapped);
  EXPECT_THAT(DescribeMouthLine(line)[2], HasSubstr("unsure"));
}

TEST(MouthLineTest, ANotchOutOfReachIsNotTaken) {
  ASSERT_OK_AND_ASSIGN(const MouthLine line,
                       FindMouthLine(GroovedFace(30, [](double) { return -16; }), 0));
  EXPECT_FALSE(line.line_is_sure());
  EXPECT_EQ(line.left_corner, MouthCornerReason::kNoNotch);
}

TEST(MouthLineTest, PartedLipsHaveTheirLineMidwayBetweenTheirEdges) {
  FaceRelief relief = GroovedFace(24, [](double) { return -3; });
  // Air from 8 mm below the start to 2 mm over it. The groove is within: what is left of one on a
  // single edge would round that edge, and move the line.
  relief.front_mm.block(64, 25, 21, 21) = -std::numeric_limits<double>::infinity();
  ASSERT_OK_AND_ASSIGN(const MouthLine line, FindMouthLine(relief, 0));
  const MouthLinePoint& middle = line.points[line.points.size() / 2];
  EXPECT_TRUE(middle.parted);
  EXPECT_EQ(middle.at.up, -3);
  EXPECT_EQ(middle.at.front, 60);
}

// Teeth 8 mm behind lips that are 10 mm apart, as a blurred CT shows them, out to 20 mm.
FaceRelief TeethBetweenLips() {
  FaceRelief relief = GroovedFace(0.5, [](double) { return 100; });
  for (Eigen::Index row = 0; row < 121; ++row) {
    const double into_gap_mm = 5 - std::abs(relief.UpOf(row) + 5);
    const double depth_mm = std::clamp(2 * into_gap_mm + 2, 0.0, 8.0);
    relief.front_mm.block(row, 15, 1, 41) -= depth_mm;
  }
  return relief;
}

TEST(MouthLineTest, TeethBehindAGapAreNotSkin) {
  ASSERT_OK_AND_ASSIGN(const MouthLine line, FindMouthLine(TeethBetweenLips(), 0));
  EXPECT_TRUE(line.line_is_sure());
  EXPECT_GT(line.parted_share, 0.9);
  for (const MouthLinePoint& point : line.points) {
    if (!point.parted) continue;
    EXPECT_NEAR(point.at.up, -5, 0.3) << point.at.left;
    EXPECT_EQ(point.at.front, 60) << point.at.left;
  }
}

// A tube hides the lower lip's edge: only the upper lip's is left.
TEST(MouthLineTest, AColumnWithOneLipEdgeIsUnsure) {
  FaceRelief relief = TeethBetweenLips();
  for (Eigen::Index row = 0; row < 70; ++row) relief.front_mm.block(row, 25, 1, 31) = 52;
  ASSERT_OK_AND_ASSIGN(const MouthLine line, FindMouthLine(relief, 0));
  EXPECT_FALSE(line.line_is_sure());
  EXPECT_FALSE(line.points[line.points.size() / 2].parted);
  EXPECT_NE(line.left_corner, MouthCornerReason::kNotchEnds);
}

TEST(MouthLineTest, ACornerTooNearToTheMidlineIsUnsureAndPutWhereMostAdultsHaveIt) {
  ASSERT_OK_AND_ASSIGN(const MouthLine line,
                       FindMouthLine(GroovedFace(18, [](double) { return 0; }), 0));
  EXPECT_EQ(line.left_corner, MouthCornerReason::kNoNotch);
  EXPECT_EQ(line.points.back().at.left, 25);
  EXPECT_THAT(DescribeMouthLine(line)[2], HasSubstr("unsure"));
}

// A hair hides the notch in two columns; a scar deepens the skin behind its end in two.
TEST(MouthLineTest, NarrowDisturbancesDoNotMoveACorner) {
  FaceRelief relief = GroovedFace(23, [](double) { return 0; });
  relief.front_mm.block(0, 35 + 21, 121, 2) = 60;
  relief.front_mm.block(76, 35 + 26, 9, 2) = 55;
  ASSERT_OK_AND_ASSIGN(const MouthLine line, FindMouthLine(relief, 0));
  EXPECT_EQ(line.left_corner, MouthCornerReason::kNotchEnds);
  EXPECT_NEAR(line.points.back().at.left, 23, 2);
}

// A moustache hides the notch from 8 to 17 mm and ends by a step at 24 mm, as if it were a corner.
TEST(MouthLineTest, ACornerIsUnsureWhereLittleOfItsHalfIsSeen) {
  FaceRelief relief = GroovedFace(24, [](double) { return 0; });
  relief.front_mm.block(0, 35 + 8, 121, 10) = 60;
  ASSERT_OK_AND_ASSIGN(const MouthLine line, FindMouthLine(relief, 0));
  EXPECT_EQ(line.left_corner, MouthCornerReason::kNoNotch);
  EXPECT_EQ(line.right_corner, MouthCornerReason::kNotchEnds);
}

// A tube hides the lower lip in two columns near the corner.
TEST(MouthLineTest, ACornerNearAHiddenPlaceIsUnsure) {
  FaceRelief relief = GroovedFace(24, [](double) { return 0; });
  relief.front_mm.block(0, 35 + 21, 87, 2) = 52;
  ASSERT_OK_AND_ASSIGN(const MouthLine line, FindMouthLine(relief, 0));
  EXPECT_EQ(line.left_corner, MouthCornerReason::kNoNotch);
  EXPECT_EQ(line.right_corner, MouthCornerReason::kNotchEnds);
}

// The upper lip ends by a step of 4 mm over the lower one, which comes forward by 2 mm again.
TEST(MouthLineTest, ClosedLipsOfWhichTheUpperOneOverhangsAreFound) {
  FaceRelief relief = GroovedFace(0.5, [](double) { return 100; });
  for (Eigen::Index row = 0; row <= 80; ++row) {
    const double below_mm = -relief.UpOf(row);
    relief.front_mm.block(row, 35 - 24, 1, 49) = 56 + std::min(below_mm / 2, 2.0);
  }
  ASSERT_OK_AND_ASSIGN(const MouthLine line, FindMouthLine(relief, 0));
  EXPECT_TRUE(line.line_is_sure());
  EXPECT_EQ(line.parted_share, 0);
  EXPECT_EQ(line.points[line.points.size() / 2].at.up, 0);
  EXPECT_EQ(line.left_corner, MouthCornerReason::kNotchEnds);
  EXPECT_NEAR(line.points.back().at.left, 24, 1);
}

// A hole of 3.5 mm, too low for parted lips, as a removed tube leaves it: tissue 20 mm behind them.
TEST(MouthLineTest, TissueDeepInTheMouthIsNotSkin) {
  FaceRelief relief = GroovedFace(24, [](double) { return 0; });
  relief.front_mm.block(77, 35 - 4, 7, 9) = 40;
  ASSERT_OK_AND_ASSIGN(const MouthLine line, FindMouthLine(relief, 0));
  const MouthLinePoint& middle = line.points[static_cast<size_t>(-line.points.front().at.left)];
  EXPECT_GT(middle.at.front, 56);
  EXPECT_LT(middle.notch_mm, kShallowNotchMm);
}

// A nose from 13 mm over the line on, 10 mm before the lips and cut off after 5 mm. The edge under
// it is steeper than the notch between the lips, and within a lip's height of the rows of the
// search.
TEST(MouthLineTest, ACutOffNoseDoesNotMoveTheLine) {
  const auto up_of = [](double /*left*/) { return 0; };
  FaceRelief relief = GroovedFace(24, up_of);
  relief.front_mm.block(80 + 26, 35 - 15, 10, 31) = 70;
  relief.front_mm.block(80 + 36, 35 - 15, 5, 31) = std::numeric_limits<double>::quiet_NaN();
  ASSERT_OK_AND_ASSIGN(const MouthLine line, FindMouthLine(relief, 0));
  ASSERT_OK_AND_ASSIGN(const MouthLine whole, FindMouthLine(GroovedFace(24, up_of), 0));
  ASSERT_EQ(line.points.size(), whole.points.size());
  for (size_t i = 0; i < line.points.size(); ++i) {
    EXPECT_EQ(line.points[i].at.up, whole.points[i].at.up) << line.points[i].at.left;
  }
  EXPECT_TRUE(line.line_is_sure());
}

TEST(MouthLineTest, SkinThatIsNotSeenEndsTheLine) {
  FaceRelief relief = GroovedFace(24, [](double) { return 0; });
  relief.front_mm.rightCols(20) = std::numeric_limits<double>::quiet_NaN();
  ASSERT_OK_AND_ASSIGN(const MouthLine line, FindMouthLine(relief, 0));
  EXPECT_EQ(line.left_corner, MouthCornerReason::kSkinNotSeen);
  EXPECT_EQ(line.right_corner, MouthCornerReason::kNotchEnds);
  relief.front_mm = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(FindMouthLine(relief, 0),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("not in view")));
}

}  // namespace
}  // namespace tissueform
