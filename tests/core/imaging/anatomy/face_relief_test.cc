// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/face_relief.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "gtest/gtest.h"
#include <Eigen/Geometry>

namespace tissueform {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// LPS: the face looks towards -y. 20 degrees of nodding, 10 of turning.
Landmarks TiltedHead() {
  const Eigen::Matrix3d turn = (Eigen::AngleAxisd(0.35, Eigen::Vector3d::UnitX()) *
                                Eigen::AngleAxisd(0.17, Eigen::Vector3d::UnitZ()))
                                   .toRotationMatrix();
  Landmarks landmarks;
  landmarks.midsagittal = {Eigen::Vector3d(1, 2, 3), turn * Eigen::Vector3d::UnitX()};
  landmarks.upper_teeth = {Eigen::Vector3d(1, 2, 3), turn * Eigen::Vector3d::UnitZ()};
  return landmarks;
}

// Voxels of 1 mm round the origin, with the HU of their face coordinates.
HeadSegmentation HeadOf(const FaceAxes& axes,
                        const std::function<double(const FaceCoordinates&)>& hu_of) {
  HeadSegmentation head;
  GridGeometry geometry;
  geometry.size = {61, 61, 61};
  geometry.spacing_mm = 1;
  geometry.origin_mm = Eigen::Vector3d::Constant(-30);
  head.hu = HuGrid(geometry);
  ForEachVoxel(LabelGrid(geometry, 1), [&](size_t index, const Eigen::Vector3d& place) {
    head.hu.values[index] = static_cast<int16_t>(std::lround(hu_of(axes.Of(place))));
  });
  return head;
}

// As a scanner blurs the edge of tissue at `front` over 4 mm: -300 HU 0.8 mm behind the middle.
double BlurredHu(double front, const FaceCoordinates& at) {
  return std::clamp(-500 + 250 * (front - at.front), -1000.0, 0.0);
}

constexpr ReliefExtent kExtent = {
    .half_width_mm = 8, .bottom_mm = -6, .top_mm = 6, .foremost_mm = 25, .depth_mm = 40};

TEST(FaceReliefTest, ASlopeIsMeasuredInTheAxesOfTheFace) {
  const FaceAxes axes(TiltedHead());
  const auto slope = [](const FaceCoordinates& at) { return 10 + at.left / 4 - at.up / 2; };
  const HeadSegmentation head =
      HeadOf(axes, [&](const FaceCoordinates& at) { return BlurredHu(slope(at), at); });
  const FaceRelief relief = MeasureFaceRelief(head, axes, kExtent);
  ASSERT_EQ(relief.front_mm.cols(), 17);
  ASSERT_EQ(relief.front_mm.rows(), 25);
  EXPECT_EQ(relief.LeftOf(0), -8);
  EXPECT_EQ(relief.UpOf(24), 6);
  for (Eigen::Index column = 0; column < 17; ++column) {
    for (Eigen::Index row = 0; row < 25; ++row) {
      const FaceCoordinates at{relief.LeftOf(column), 0, relief.UpOf(row)};
      EXPECT_NEAR(relief.front_mm(row, column), slope(at) - 0.8, 0.05);
    }
  }
}

TEST(FaceReliefTest, HairBeforeTheSkinIsNotSkin) {
  const FaceAxes axes(TiltedHead());
  const HeadSegmentation head = HeadOf(axes, [&](const FaceCoordinates& at) {
    const bool is_hair = at.front > 12 && at.front < 16 && at.up > 0;
    return is_hair ? -400 : BlurredHu(10, at);
  });
  const FaceRelief relief = MeasureFaceRelief(head, axes, kExtent);
  EXPECT_NEAR(relief.front_mm(24, 8), 10 - 0.8, 0.05);
  EXPECT_NEAR(relief.front_mm(0, 8), 10 - 0.8, 0.05);
}

TEST(FaceReliefTest, RaysThatMeetNothingOrTheEndOfTheCtSayWhich) {
  const FaceAxes axes(TiltedHead());
  HeadSegmentation head = HeadOf(
      axes, [&](const FaceCoordinates& at) { return at.up > 2 ? -1000 : BlurredHu(10, at); });
  head.cut = LabelGrid(head.hu.geometry);
  ForEachVoxel(LabelGrid(head.hu.geometry, 1), [&](size_t index, const Eigen::Vector3d& place) {
    const FaceCoordinates at = axes.Of(place);
    if (at.up < -2 && std::abs(at.front - 9) < 1) head.cut.values[index] = 1;
  });
  const FaceRelief relief = MeasureFaceRelief(head, axes, kExtent);
  EXPECT_EQ(relief.front_mm(24, 8), -kInfinity);
  EXPECT_NEAR(relief.front_mm(12, 8), 10 - 0.8, 0.05);
  EXPECT_TRUE(std::isnan(relief.front_mm(0, 8)));
}

// The CT ends 5 mm before the skin's middle: rays that begin before it cross air.
TEST(FaceReliefTest, RaysMayBeginOutsideTheCt) {
  const FaceAxes axes(TiltedHead());
  const HeadSegmentation head =
      HeadOf(axes, [&](const FaceCoordinates& at) { return BlurredHu(10, at); });
  ReliefExtent extent = kExtent;
  extent.foremost_mm = 90;
  extent.depth_mm = 100;
  EXPECT_NEAR(MeasureFaceRelief(head, axes, extent).front_mm(12, 8), 10 - 0.8, 0.05);
  extent.depth_mm = 75;
  EXPECT_EQ(MeasureFaceRelief(head, axes, extent).front_mm(12, 8), -kInfinity);
}

}  // namespace
}  // namespace tissueform
