// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/lip_seam.h"

#include <cmath>
#include <limits>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/imaging/anatomy/bone_parts.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::StatusIs;

constexpr double kUpperFrontMm = 50;
constexpr double kLowerFrontMm = 48;
constexpr int kHalfWidthMm = 25;

double ArchFront(double foremost, double left) { return foremost - left * left / 20; }
double SkinFront(double left) { return 62 - left * left / 30; }
double LineUp(double left) { return 3 - std::abs(left) / 25; }

// Axes of the face: x left, -y front, z up.
Landmarks MadeLandmarks() {
  Landmarks landmarks;
  landmarks.midsagittal.normal = Eigen::Vector3d::UnitX();
  landmarks.upper_incisor = {0, -kUpperFrontMm, 0};
  landmarks.lower_incisor = {0, -kLowerFrontMm, -2};
  return landmarks;
}

// Two jaws whose fronts are parabolas, and a spine behind them.
LabelGrid MadeParts(bool with_lower_jaw = true) {
  GridGeometry geometry;
  geometry.size = {71, 111, 30};
  geometry.origin_mm = {-35, -60, -15};
  LabelGrid parts(geometry, 0);
  for (int z = 0; z < geometry.size[2]; ++z) {
    for (int y = 0; y < geometry.size[1]; ++y) {
      for (int x = 0; x < geometry.size[0]; ++x) {
        const Eigen::Vector3d at = geometry.Centre(x, y, z);
        const double front = -at.y();
        uint8_t& label = parts.At(x, y, z);
        if (at.z() >= 0 && front < ArchFront(kUpperFrontMm, at.x())) label = kCranium;
        if (at.z() <= -2 && front < ArchFront(kLowerFrontMm, at.x()) && with_lower_jaw) {
          label = kMandible;
        }
      }
    }
  }
  return parts;
}

MouthLine MadeLine() {
  std::vector<Eigen::Vector3d> places;
  for (int left = -kHalfWidthMm; left <= kHalfWidthMm; ++left) {
    places.emplace_back(left, -SkinFront(left), LineUp(left));
  }
  return *MouthLineThrough(places, MadeLandmarks());
}

class LipSeamTest : public ::testing::Test {
 protected:
  LipSeam seam_ = *LipSeam::Create(MadeLine(), MadeParts(), MadeLandmarks());
};

TEST_F(LipSeamTest, RunsFromTheMouthLineToTheEdgeOfTheUpperTeeth) {
  for (const double left : {-20.5, -7.0, 0.0, 3.25, 24.0}) {
    EXPECT_NEAR(seam_.HeightMm({left, -SkinFront(left), LineUp(left)}), 0, 0.05) << left;
    EXPECT_NEAR(seam_.HeightMm({left, -ArchFront(kUpperFrontMm, left), 0}), 0, 0.4) << left;
    const double middle = (SkinFront(left) + ArchFront(kUpperFrontMm, left)) / 2;
    EXPECT_NEAR(seam_.HeightMm({left, -middle, LineUp(left) / 2}), 0, 0.25) << left;
  }
  EXPECT_NEAR(seam_.HeightMm({5, -55, 7}) - seam_.HeightMm({5, -55, 2}), 5, 1e-12);
}

TEST_F(LipSeamTest, IsContinuousFarBeyondTheCorners) {
  for (const double front : {20.0, 45.0, 58.0, 80.0}) {
    double before = seam_.HeightMm({-60, -front, 1});
    for (int step = -6000; step <= 6000; ++step) {
      const double left = step * 0.01;
      const double height = seam_.HeightMm({left, -front, 1});
      ASSERT_LT(std::abs(height - before), 0.02) << left << " " << front;
      before = height;
    }
  }
}

TEST_F(LipSeamTest, EndsAtTheCornersAndAShortWayBehindTheArch) {
  EXPECT_TRUE(seam_.Holds({0, -60, 3}));
  EXPECT_TRUE(seam_.Holds({0, -48.5, 0}));
  EXPECT_FALSE(seam_.Holds({0, -45, 0}));
  EXPECT_TRUE(seam_.Holds({24.9, -45, 2}));
  EXPECT_FALSE(seam_.Holds({25.1, -45, 2}));
  EXPECT_TRUE(seam_.IsBeside({34, -20, 2}, 10));
  EXPECT_FALSE(seam_.IsBeside({-36, -20, 2}, 10));
}

TEST_F(LipSeamTest, NormalsAreTheArchsLaidIntoAPlane) {
  const Eigen::Vector3d up = Eigen::Vector3d(0, 0.3, 1).normalized();
  for (const double left : {-22.0, -8.0, 0.0, 15.0}) {
    for (const uint8_t jaw : {kCranium, kMandible}) {
      const Eigen::Vector3d normal = seam_.Outward({left, -40, 3}, jaw, up);
      EXPECT_NEAR(normal.norm(), 1, 1e-12);
      EXPECT_NEAR(normal.dot(up), 0, 1e-12);
      // Of front = foremost - left^2 / 20, seen from above.
      const double angle = std::atan2(left / 10, 1);
      EXPECT_NEAR(std::atan2(normal.x(), -normal.y() * std::sqrt(1 + 0.09)), angle, 0.05) << left;
    }
  }
  EXPECT_NEAR(seam_.BeforeArchMm({0, -55, 0}, kCranium), 5, 0.5);
  EXPECT_NEAR(seam_.BeforeArchMm({0, -55, 0}, kMandible), 7, 0.5);
}

TEST_F(LipSeamTest, LipsCloseAtTheLineWhereTheCtShowsNoAir) {
  MouthLine line = MadeLine();
  const double middle = (line.points.front().at.left + line.points.back().at.left) / 2;
  for (MouthLinePoint& point : line.points) point.parted = point.at.left > middle;
  const LipSeam seam = *LipSeam::Create(line, MadeParts(), MadeLandmarks());
  for (const double left : {-20.0, -10.0, 10.0, 20.0}) {
    const double front = SkinFront(left);
    EXPECT_TRUE(seam_.ClosesAt({left, -front, LineUp(left)})) << left;
    EXPECT_TRUE(seam_.ClosesAt({left, 3 - front, LineUp(left)})) << left;
    EXPECT_FALSE(seam_.ClosesAt({left, 6 - front, LineUp(left)})) << left;
    EXPECT_EQ(seam.ClosesAt({left, -front, LineUp(left)}), left < middle) << left;
  }
}

TEST_F(LipSeamTest, StretchesRunFromCornerToCorner) {
  const double right = MadeLine().points.front().at.left;
  const double left = MadeLine().points.back().at.left;
  EXPECT_DOUBLE_EQ(seam_.WidestStretchWithoutMm({}), left - right);
  const auto at = [](double x) { return Eigen::Vector3d(x, -SkinFront(x), LineUp(x)); };
  EXPECT_NEAR(seam_.WidestStretchWithoutMm({at(left - 3), at(right + 4)}), left - right - 7, 1e-9);
  EXPECT_NEAR(seam_.WidestStretchWithoutMm({at(right + 1), at(left - 30)}), 30, 1e-9);
}

TEST(LipSeamCreationTest, AJawThatShowsNoFrontIsNamed) {
  EXPECT_THAT(
      LipSeam::Create(MadeLine(), MadeParts(false), MadeLandmarks()).status(),
      StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("the lower jaw shows no front")));
}

TEST(DentalArchTest, LeavesOutOutliers) {
  std::vector<Eigen::Vector2d> points;
  for (int left = -27; left <= 27; left += 3) {
    points.emplace_back(left, ArchFront(kUpperFrontMm, left));
  }
  points[4].y() -= 90;  // the spine, where a tooth is missing
  points[13].y() += 6;  // a bracket
  ASSERT_OK_AND_ASSIGN(const DentalArch arch, DentalArch::Fit(points));
  for (int left = -27; left <= 27; ++left) {
    EXPECT_NEAR(arch.FrontOf(left), ArchFront(kUpperFrontMm, left), 0.5) << left;
  }
  // Beyond the fitted width it goes on straight.
  const double step = arch.FrontOf(40) - arch.FrontOf(39);
  EXPECT_NEAR(arch.FrontOf(31) - arch.FrontOf(30), step, 1e-9);
}

TEST(DentalArchTest, NeedsBothSides) {
  std::vector<Eigen::Vector2d> points;
  for (int left = -27; left <= 9; left += 2) points.emplace_back(left, 50);
  EXPECT_FALSE(DentalArch::Fit(points).ok());
  EXPECT_FALSE(DentalArch::Fit({{-20, 40}, {0, 50}, {20, 40}}).ok());
}

TEST(GivenMouthLineTest, RunsFromRightToLeftWithinAMouth) {
  const Landmarks landmarks = MadeLandmarks();
  const auto status_of = [&landmarks](const std::vector<Eigen::Vector3d>& places) {
    return MouthLineThrough(places, landmarks).status();
  };
  ASSERT_OK_AND_ASSIGN(const MouthLine line,
                       MouthLineThrough({{-25, -50, 1}, {0, -60, 3}, {22, -52, 1}}, landmarks));
  EXPECT_TRUE(line.line_is_sure());
  EXPECT_EQ(DescribeMouthLine(line).size(), 1U);
  EXPECT_THAT(status_of({{-25, -50, 1}, {22, -52, 1}}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("three points")));
  // It crosses itself, or is read from left to right.
  EXPECT_THAT(status_of({{-25, -50, 1}, {3, -60, 3}, {0, -60, 3}, {22, -52, 1}}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("point 2")));
  EXPECT_FALSE(status_of({{22, -52, 1}, {0, -60, 3}, {-25, -50, 1}}).ok());
  EXPECT_FALSE(status_of({{-60, -50, 1}, {0, -60, 3}, {22, -52, 1}}).ok());
  EXPECT_THAT(status_of({{-25, -50, 1}, {0, -60, 39}, {22, -52, 1}}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("point 1")));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(status_of({{-25, -50, 1}, {nan, -60, 3}, {22, -52, 1}}).ok());
}

}  // namespace
}  // namespace tissueform
