// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/constraints/head_frame.h"

#include <cmath>
#include <fstream>
#include <random>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include <Eigen/Geometry>

#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;
using ::testing::HasSubstr;
using testing::IsOk;
using testing::StatusIs;
using Json = nlohmann::json;

constexpr double kDegree = M_PI / 180;

// What programs in other languages are tested against, too; not made by ours.
const Json& GoldenVectors() {
  static const Json* const vectors =
      new Json(Json::parse(std::ifstream(testing::SourcePath("tests/data/pitch_roll_yaw.json"))));
  return *vectors;
}

Vector3d VectorIn(const Json& json) {
  return {json[0].get<double>(), json[1].get<double>(), json[2].get<double>()};
}

HeadFrame FrameNamed(const std::string& name) {
  const Json& frame = GoldenVectors()["head_frames"][name];
  return {.origin_mm = Vector3d::Zero(),
          .left = VectorIn(frame["left"]),
          .posterior = VectorIn(frame["posterior"]),
          .superior = VectorIn(frame["superior"]),
          .source = "landmarks"};
}

HeadAngles AnglesIn(const Json& json) {
  return {json["pitch_deg"].get<double>(), json["roll_deg"].get<double>(),
          json["yaw_deg"].get<double>()};
}

void ExpectSameRotation(const Vector3d& a, const Vector3d& b, const std::string& what) {
  EXPECT_LT((RotationMatrix(a) - RotationMatrix(b)).norm(), 1e-6) << what;
}

// -180 and 180 degrees are one turn.
double Apart(double a_deg, double b_deg) { return std::abs(std::remainder(a_deg - b_deg, 360)); }

TEST(HeadAnglesTest, TurnsAreThoseOfTheGoldenVectors) {
  for (const Json& rotation : GoldenVectors()["rotations"]) {
    const HeadFrame frame = FrameNamed(rotation["head_frame"].get<std::string>());
    const Vector3d wanted = VectorIn(rotation["rotation_vector_deg"]) * kDegree;
    const Vector3d made = RotationVectorFromAngles(AnglesIn(rotation), frame);
    ExpectSameRotation(made, wanted, rotation["name"].get<std::string>());
    if (wanted.norm() < 0.999 * M_PI) {
      EXPECT_LT((made - wanted).norm(), 1e-9) << rotation["name"];
    }
  }
}

TEST(HeadAnglesTest, AnglesAreThoseOfTheGoldenVectors) {
  for (const Json& rotation : GoldenVectors()["rotations"]) {
    const HeadAngles wanted = AnglesIn(rotation);
    const HeadAngles found =
        AnglesFromRotationVector(VectorIn(rotation["rotation_vector_deg"]) * kDegree,
                                 FrameNamed(rotation["head_frame"].get<std::string>()));
    EXPECT_LT(Apart(found.pitch_deg, wanted.pitch_deg), 1e-5) << rotation["name"];
    EXPECT_LT(Apart(found.roll_deg, wanted.roll_deg), 1e-5) << rotation["name"];
    EXPECT_LT(Apart(found.yaw_deg, wanted.yaw_deg), 1e-5) << rotation["name"];
  }
}

TEST(HeadAnglesTest, OneRotationHasOneSetOfAngles) {
  for (const Json& same : GoldenVectors()["same_rotation"]) {
    const HeadFrame frame = FrameNamed(same["head_frame"].get<std::string>());
    const HeadAngles found =
        AnglesFromRotationVector(RotationVectorFromAngles(AnglesIn(same["given"]), frame), frame);
    const HeadAngles wanted = AnglesIn(same["told"]);
    EXPECT_LT(Apart(found.pitch_deg, wanted.pitch_deg), 1e-5) << same["name"];
    EXPECT_LT(Apart(found.roll_deg, wanted.roll_deg), 1e-5) << same["name"];
    EXPECT_LT(Apart(found.yaw_deg, wanted.yaw_deg), 1e-5) << same["name"];
  }
}

TEST(HeadAnglesTest, EveryRotationComesBackFromItsAngles) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> number(-2, 2);
  const HeadFrame frame = FrameNamed("tilted");
  for (int trial = 0; trial < 1000; ++trial) {
    const Vector3d rotation(number(random), number(random), number(random));
    const HeadAngles angles = AnglesFromRotationVector(rotation, frame);
    EXPECT_LE(std::abs(angles.pitch_deg), 90);
    EXPECT_LE(std::abs(angles.roll_deg), 180);
    EXPECT_LE(std::abs(angles.yaw_deg), 180);
    ExpectSameRotation(RotationVectorFromAngles(angles, frame), rotation, "");
  }
}

TEST(HeadAnglesTest, NearTheGimbalRotationsStillComeBack) {
  const HeadFrame frame;
  for (const double below : {1e-3, 1e-5, 1e-7, 1e-9, 0.0}) {
    for (const double sign : {-1.0, 1.0}) {
      const HeadAngles angles{.pitch_deg = sign * (90 - below), .roll_deg = 33, .yaw_deg = -71};
      const Vector3d rotation = RotationVectorFromAngles(angles, frame);
      ExpectSameRotation(RotationVectorFromAngles(AnglesFromRotationVector(rotation, frame), frame),
                         rotation, "");
    }
  }
}

// By hand, in words: what the signs mean for a patient.
TEST(HeadAnglesTest, SignsMatchClinicalConventions) {
  const HeadFrame frame;
  const auto turned = [&](const HeadAngles& angles, const Vector3d& point) {
    return Vector3d(RotationMatrix(RotationVectorFromAngles(angles, frame)) * point);
  };
  const Vector3d chin(0, -10, 0);
  const Vector3d left_molar(10, 0, 0);
  EXPECT_GT(turned({.pitch_deg = 5}, chin).z(), 0.5);        // the chin goes up
  EXPECT_LT(turned({.roll_deg = 5}, left_molar).z(), -0.5);  // the left side goes down
  EXPECT_GT(turned({.yaw_deg = 5}, chin).x(), 0.5);          // the chin goes to the left
}

TEST(HeadFrameTest, AxesMustBeARightHandedFrame) {
  EXPECT_THAT(CheckHeadFrame(HeadFrame{}), IsOk());
  EXPECT_THAT(CheckHeadFrame(FrameNamed("tilted")), IsOk());
  HeadFrame mirrored;
  mirrored.left = -mirrored.left;
  EXPECT_THAT(CheckHeadFrame(mirrored), StatusIs(testing::kInvalid, HasSubstr("left x posterior")));
  HeadFrame skew;
  skew.posterior = Vector3d(0.01, 1, 0).normalized();
  EXPECT_THAT(CheckHeadFrame(skew), StatusIs(testing::kInvalid));
  HeadFrame long_axis;
  long_axis.superior *= 2;
  EXPECT_THAT(CheckHeadFrame(long_axis), StatusIs(testing::kInvalid));
  HeadFrame nowhere;
  nowhere.origin_mm.x() = std::nan("");
  EXPECT_THAT(CheckHeadFrame(nowhere), StatusIs(testing::kInvalid));
}

}  // namespace
}  // namespace tissueform
