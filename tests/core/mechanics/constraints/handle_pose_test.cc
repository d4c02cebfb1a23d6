// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/constraints/handle_pose.h"

#include <cmath>
#include <limits>
#include <numbers>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <Eigen/LU>
#include <unsupported/Eigen/MatrixFunctions>

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::IsOk;
using testing::StatusIs;

Eigen::Matrix3d CrossProductMatrix(const Eigen::Vector3d& w) {
  Eigen::Matrix3d matrix;
  matrix << 0, -w.z(), w.y(), w.z(), 0, -w.x(), -w.y(), w.x(), 0;
  return matrix;
}

TEST(RotationMatrixTest, IsTheMatrixExponential) {
  for (const Eigen::Vector3d& w :
       {Eigen::Vector3d(0.3, -0.7, 1.1), Eigen::Vector3d(1e-9, 2e-9, -1e-9),
        Eigen::Vector3d(0, 0, 7.5), Eigen::Vector3d(0, 0, 0)}) {
    const Eigen::Matrix3d oracle = CrossProductMatrix(w).exp();
    EXPECT_LT((RotationMatrix(w) - oracle).norm(), 1e-13) << w.transpose();
  }
}

TEST(RotationMatrixTest, OfAFullTurnIsTheIdentity) {
  EXPECT_LT((RotationMatrix({0, 2 * std::numbers::pi, 0}) - Eigen::Matrix3d::Identity()).norm(),
            1e-15);
}

TEST(ApplyPoseTest, TurnsAndScalesAboutThePivotThenTranslates) {
  HandlePose pose;
  pose.rotation_vector = {0, 0, std::numbers::pi / 2};
  pose.pivot_mm = {1, 2, 3};
  pose.scale = 2;
  pose.translation_mm = {10, 20, 30};
  EXPECT_LT((ApplyPose(pose, {2, 2, 3}) - Eigen::Vector3d(11, 24, 33)).norm(), 1e-14);
  EXPECT_EQ(ApplyPose(HandlePose{}, {4, 5, 6}), Eigen::Vector3d(4, 5, 6));
}

TEST(CheckPoseTest, NamesTheFieldThatIsNotFinite) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(CheckPose(HandlePose{}), IsOk());
  HandlePose pose;
  pose.rotation_vector.y() = nan;
  EXPECT_THAT(CheckPose(pose),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("rotation vector")));
  pose = {};
  pose.pivot_mm.x() = std::numeric_limits<double>::infinity();
  EXPECT_THAT(CheckPose(pose), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("pivot")));
  pose = {};
  pose.translation_mm.z() = nan;
  EXPECT_THAT(CheckPose(pose),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("translation")));
}

TEST(CheckPoseTest, ScaleMustBePositive) {
  for (const double scale : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    HandlePose pose;
    pose.scale = scale;
    EXPECT_THAT(CheckPose(pose), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("scale")));
  }
}

TEST(CheckPoseTest, NumbersThatWouldOverflowAreRefused) {
  HandlePose pose;
  pose.scale = 1e200;
  EXPECT_THAT(CheckPose(pose), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("at most")));
  pose = {};
  pose.translation_mm.z() = 1e300;
  EXPECT_THAT(CheckPose(pose),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("translation")));
  pose = {};
  pose.pivot_mm.x() = -1e300;
  EXPECT_THAT(CheckPose(pose), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("pivot")));
  pose = {};
  pose.rotation_vector.y() = -1e300;
  EXPECT_THAT(CheckPose(pose),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("rotation vector")));
}

TEST(CheckPoseTest, TheLargestLegalNumbersGiveFinitePositions) {
  const HandlePose pose{.rotation_vector = {1e6, -1e6, 1e6},
                        .pivot_mm = {1e9, -1e9, 1e9},
                        .translation_mm = {-1e9, 1e9, 1e9},
                        .scale = 1e6};
  ASSERT_THAT(CheckPose(pose), IsOk());
  EXPECT_TRUE(ApplyPose(pose, {1, 2, 3}).allFinite());
  EXPECT_LT((RotationMatrix(pose.rotation_vector) * RotationMatrix(-pose.rotation_vector) -
             Eigen::Matrix3d::Identity())
                .norm(),
            1e-9);
}

HandlePose Turned() {
  return {.rotation_vector = {0.3, -0.7, 7.1},
          .pivot_mm = {12.3, -4.5, 0.1},
          .translation_mm = {1.7, -6.0, 0.3},
          .scale = 0.2};
}

void ExpectSame(const HandlePose& a, const HandlePose& b) {
  EXPECT_EQ(a.rotation_vector, b.rotation_vector);
  EXPECT_EQ(a.pivot_mm, b.pivot_mm);
  EXPECT_EQ(a.translation_mm, b.translation_mm);
  EXPECT_EQ(a.scale, b.scale);
}

TEST(PoseBetweenTest, MeetsBothEndsToTheLastBit) {
  HandlePose other = Turned();
  other.scale = 1.7;
  other.rotation_vector *= -0.37;
  ExpectSame(PoseBetween(Turned(), other, 0), Turned());
  ExpectSame(PoseBetween(Turned(), other, 1), other);
}

TEST(PoseBetweenTest, GoesTheSameWayInBothDirections) {
  HandlePose other = Turned();
  other.scale = 3;
  other.translation_mm = {-4, 0, 2};
  const HandlePose there = PoseBetween(Turned(), other, 0.25);
  const HandlePose back = PoseBetween(other, Turned(), 0.75);
  ExpectSame(there, back);
}

TEST(PoseBetweenTest, ScaleOfBothEndsStaysAllTheWay) {
  HandlePose a = Turned();
  HandlePose b = Turned();
  for (const double scale : {1.0, 0.2, 1.1}) {
    a.scale = b.scale = scale;
    for (const double t : {0.1, 1.0 / 3, 0.7, 4.0 / 3}) {
      EXPECT_EQ(PoseBetween(a, b, t).scale, scale);
    }
  }
}

TEST(PartOfPoseTest, LinearPartIsTheExponentialOfThatPartOfTheLogarithm) {
  const HandlePose pose = Turned();
  const Eigen::Matrix3d logarithm =
      std::log(pose.scale) * Eigen::Matrix3d::Identity() + CrossProductMatrix(pose.rotation_vector);
  for (const double t : {0.0, 0.3, 1.0, 4.0 / 3}) {
    const HandlePose part = PartOfPose(pose, t);
    const Eigen::Matrix3d oracle = (t * logarithm).exp();
    EXPECT_LT((part.scale * RotationMatrix(part.rotation_vector) - oracle).norm(), 1e-12) << t;
  }
}

TEST(PartOfPoseTest, PartOfAPartIsThePartOfTheirProduct) {
  const HandlePose once = PartOfPose(Turned(), 0.25);
  HandlePose twice = PartOfPose(PartOfPose(Turned(), 0.5), 0.5);
  EXPECT_DOUBLE_EQ(once.scale, twice.scale);
  twice.scale = once.scale;
  ExpectSame(once, twice);
}

TEST(PartOfPoseTest, ZeroPartIsRestAndThePivotStays) {
  ExpectSame(PartOfPose(Turned(), 0), RestOf(Turned()));
  for (const double t : {0.1, 0.3, 0.9, 1.5}) {
    EXPECT_EQ(PartOfPose(Turned(), t).pivot_mm, Turned().pivot_mm);
  }
}

TEST(PartOfPoseTest, BeyondThePoseTheScaleStaysPositive) {
  EXPECT_THAT(CheckPose(PartOfPose(Turned(), 4.0 / 3)), IsOk());
}

}  // namespace
}  // namespace tissueform
