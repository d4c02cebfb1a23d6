// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/constraints/handle_pose.h"

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
}

}  // namespace
}  // namespace tissueform
