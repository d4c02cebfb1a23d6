// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/patient_axes.h"

#include <algorithm>
#include <set>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <Eigen/LU>

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using tissueform::testing::IsOk;
using tissueform::testing::StatusIs;

using ::tissueform::testing::kInvalid;

TEST(PatientAxesTest, DistinguishesFortyEightOrientations) {
  const std::string letters = "LRAPSI";
  std::set<std::string> valid;
  for (const char a : letters) {
    for (const char b : letters) {
      for (const char c : letters) {
        const std::string axes{a, b, c};
        if (!CheckAxes(axes).ok()) continue;
        valid.insert(axes);
        EXPECT_EQ(AxesOf(DirectionOf(axes)), axes);
        EXPECT_NEAR(std::abs(DirectionOf(axes).determinant()), 1, 1e-12);
      }
    }
  }
  EXPECT_EQ(valid.size(), 48U);
}

TEST(PatientAxesTest, LettersSayWhereAxesGrowToward) {
  EXPECT_EQ(DirectionOf("LPS"), Eigen::Matrix3d::Identity());
  const Eigen::Matrix3d head = DirectionOf("RPI");
  EXPECT_EQ(head.col(0), Eigen::Vector3d(-1, 0, 0));  // the right is where LPS's x falls
  EXPECT_EQ(head.col(1), Eigen::Vector3d(0, 1, 0));
  EXPECT_EQ(head.col(2), Eigen::Vector3d(0, 0, -1));
  EXPECT_EQ(DirectionOf("SLA").col(0), Eigen::Vector3d(0, 0, 1));
}

TEST(PatientAxesTest, OtherLettersAreRefused) {
  for (const char* axes : {"", "LP", "LPSS", "LPL", "LRS", "lps", "XYZ", "LP "}) {
    EXPECT_THAT(CheckAxes(axes), StatusIs(kInvalid, HasSubstr("\"axes\""))) << axes;
  }
}

TEST(PatientAxesTest, RecipeGivesTheAxesThatAFileLacks) {
  CtVolume volume;
  volume.origin_mm = {1, 2, 3};
  EXPECT_THAT(PlaceVolume(false, "why", "RPI", &volume), IsOk());
  EXPECT_EQ(volume.direction, DirectionOf("RPI"));
  EXPECT_EQ(volume.origin_mm, Eigen::Vector3d(-1, 2, -3));
  CtVolume unplaced;
  EXPECT_THAT(PlaceVolume(false, "why", "", &unplaced), StatusIs(kInvalid, HasSubstr("(why)")));
}

TEST(PatientAxesTest, DirectionsOfTheFileStayWhereTheRecipeAgrees) {
  for (const bool stated : {true, false}) {
    CtVolume volume;
    volume.direction = DirectionOf("RPI");
    volume.origin_mm = {1, 2, 3};
    EXPECT_THAT(PlaceVolume(stated, "", "RPI", &volume), IsOk());
    EXPECT_EQ(volume.origin_mm, Eigen::Vector3d(1, 2, 3));
    EXPECT_THAT(PlaceVolume(stated, "", "LPI", &volume),
                StatusIs(kInvalid, HasSubstr("contradicts")));
  }
}

}  // namespace
}  // namespace tissueform
