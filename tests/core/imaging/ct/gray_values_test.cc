// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/gray_values.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/imaging/ct/cylinder_field.h"
#include "core/imaging/ct/unscanned.h"
#include "tests/testing/cone_beam.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::tissueform::testing::ConeBeam;
using ::tissueform::testing::ConeBeamOf;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::kInvalid;
using ::tissueform::testing::StatusIs;

constexpr int kSide = 90;
constexpr int kSlices = 20;
const Eigen::Vector2d kMiddle(45, 45);

// An elliptic head in noisy air, with a ring of bone, larger than the field of view.
CtVolume Head() {
  CtVolume head;
  head.size = {kSide, kSide, kSlices};
  std::mt19937 random(5);  // NOLINT: the same noise every time
  std::normal_distribution<double> noise(0, 15);
  for (int k = 0; k < kSlices; ++k) {
    for (int j = 0; j < kSide; ++j) {
      for (int i = 0; i < kSide; ++i) {
        const double out = std::hypot((i - 45) / 42.0, (j - 50) / 36.0);
        const double hu = out > 1 ? -1000 : out > 0.7 || out < 0.5 ? 40 : 950;
        head.hu.push_back(static_cast<int16_t>(std::lround(hu + noise(random))));
      }
    }
  }
  return head;
}

ConeBeam Beam(int16_t outside) {
  ConeBeam beam;
  beam.axis_mm = kMiddle;
  beam.radius_mm = 38;
  beam.outside = outside;
  return beam;
}

class CylinderFieldTest : public ::testing::TestWithParam<int16_t> {};

TEST_P(CylinderFieldTest, IsFoundWhateverIsOutside) {
  const CtVolume cone = ConeBeamOf(Head(), Beam(GetParam()));
  const std::optional<CylinderField> field = FindCylinderField(cone);
  ASSERT_TRUE(field.has_value());
  EXPECT_EQ(field->axis, 2);
  EXPECT_EQ(field->outside_value, GetParam());
  EXPECT_NEAR(field->center_voxels.x(), kMiddle.x(), 0.3);
  EXPECT_NEAR(field->center_voxels.y(), kMiddle.y(), 0.3);
  EXPECT_LE(field->radius_mm, 38);
  EXPECT_GE(field->radius_mm, 35);
}

TEST_P(CylinderFieldTest, IsUnscannedOutside) {
  CtVolume cone = ConeBeamOf(Head(), Beam(GetParam()));
  cone.has_gray_values = true;
  ASSERT_TRUE(PrepareValues({}, &cone).ok());
  EXPECT_EQ(cone.At(2, 2, 3), -1024);
  const std::vector<uint8_t> unscanned = FindUnscanned(cone, 2);
  ASSERT_EQ(unscanned.size(), cone.hu.size());
  EXPECT_EQ(unscanned[2 + kSide * 2], 1);
  EXPECT_EQ(unscanned[45 + kSide * 45], 0);
}

INSTANTIATE_TEST_SUITE_P(Outside, CylinderFieldTest,
                         ::testing::Values(int16_t{-1000}, int16_t{0}, int16_t{4095}),
                         [](const auto& test) {
                           return (test.param < 0 ? "Minus" : "Plus") +
                                  std::to_string(std::abs(test.param));
                         });

TEST(CylinderFieldTest, IsFoundAlongEveryAxis) {
  const CtVolume upright = ConeBeamOf(Head(), Beam(0));
  CtVolume turned = upright;
  turned.size = {kSlices, kSide, kSide};
  for (int k = 0; k < kSide; ++k) {
    for (int j = 0; j < kSide; ++j) {
      for (int i = 0; i < kSlices; ++i) {
        turned.hu[static_cast<size_t>(i + kSlices * (j + kSide * k))] = upright.At(j, k, i);
      }
    }
  }
  const std::optional<CylinderField> field = FindCylinderField(turned);
  ASSERT_TRUE(field.has_value());
  EXPECT_EQ(field->axis, 0);
}

TEST(CylinderFieldTest, NoiseBoxAndRoundHeadInAirHaveNoField) {
  EXPECT_FALSE(FindCylinderField(Head()).has_value());
  CtVolume ball = Head();
  for (int k = 0; k < kSlices; ++k) {
    for (int j = 0; j < kSide; ++j) {
      for (int i = 0; i < kSide; ++i) {
        const bool inside = std::hypot((i - 45) / 40.0, (j - 45) / 40.0, (k - 10) / 9.5) < 1;
        ball.hu[static_cast<size_t>(i + kSide * (j + kSide * k))] =
            inside ? int16_t{40} : int16_t{-1000};
      }
    }
  }
  EXPECT_FALSE(FindCylinderField(ball).has_value());
}

TEST(GrayValuesTest, ComeToTheScaleOfHu) {
  const CtVolume head = Head();
  CtVolume cone = ConeBeamOf(head, Beam(0));
  cone.has_gray_values = true;
  const absl::StatusOr<CtValuesReport> report = PrepareValues({}, &cone);
  ASSERT_THAT(report.status(), IsOk());
  EXPECT_TRUE(report->gray);
  double error = 0;
  int64_t count = 0;
  for (size_t i = 0; i < cone.hu.size(); ++i) {
    if (cone.hu[i] == -1024) continue;
    error += std::abs(cone.hu[i] - head.hu[i]);
    ++count;
  }
  // Noise of 60 HU has a mean of 48; cupping leaves up to 10 % of the density.
  EXPECT_LT(error / static_cast<double>(count), 90);
  EXPECT_NEAR(report->levels.tissue_above, (report->levels.air + report->levels.soft) / 2, 1e-9);
  EXPECT_NEAR(report->levels.bone_above, (report->levels.soft + report->levels.hard) / 2, 1e-9);
  EXPECT_NEAR(report->tissue_above_hu, -480, 2);
  EXPECT_NEAR(report->bone_above_hu, 485, 2);
}

TEST(GrayValuesTest, ThresholdsOfTheRecipeAreTaken) {
  CtVolume cone = ConeBeamOf(Head(), Beam(0));
  cone.has_gray_values = true;
  CtReadOptions options;
  options.bone_above_gray = 1150;
  CtVolume copy = cone;
  const absl::StatusOr<CtValuesReport> found = PrepareValues({}, &copy);
  ASSERT_THAT(found.status(), IsOk());
  copy = cone;
  const absl::StatusOr<CtValuesReport> report = PrepareValues(options, &copy);
  ASSERT_THAT(report.status(), IsOk());
  EXPECT_EQ(report->levels.bone_above, 1150);
  EXPECT_EQ(report->levels.tissue_above, found->levels.tissue_above);
  EXPECT_LT(report->bone_above_hu, found->bone_above_hu);
  // Lower, so that more is tissue; the other stays that of the histogram.
  options = {};
  options.tissue_above_gray = found->levels.tissue_above - 50;
  copy = cone;
  const absl::StatusOr<CtValuesReport> lower = PrepareValues(options, &copy);
  ASSERT_THAT(lower.status(), IsOk());
  EXPECT_EQ(lower->levels.tissue_above, *options.tissue_above_gray);
  EXPECT_EQ(lower->levels.bone_above, found->levels.bone_above);
  EXPECT_LT(lower->tissue_above_hu, found->tissue_above_hu);
  EXPECT_EQ(lower->bone_above_hu, found->bone_above_hu);
  for (const double wrong : {found->levels.air - 1, found->levels.soft + 1}) {
    options.tissue_above_gray = wrong;
    copy = cone;
    EXPECT_THAT(PrepareValues(options, &copy).status(),
                StatusIs(kInvalid, HasSubstr("correct \"tissue_above_gray\"")));
  }
  options = {};
  copy = cone;
  options.bone_above_gray = 500;
  EXPECT_THAT(PrepareValues(options, &copy).status(),
              StatusIs(kInvalid, HasSubstr("correct \"tissue_above_gray\"")));
}

TEST(GrayValuesTest, HuStayBitwiseAndShiftedHuAreGray) {
  const CtVolume head = Head();
  CtVolume same = head;
  absl::StatusOr<CtValuesReport> report = PrepareValues({}, &same);
  ASSERT_TRUE(report.ok());
  EXPECT_FALSE(report->gray);
  EXPECT_EQ(same.hu, head.hu);
  CtReadOptions options;
  options.tissue_above_gray = 300;
  EXPECT_THAT(PrepareValues(options, &same).status(), StatusIs(kInvalid, HasSubstr("are HU")));

  CtVolume shifted = head;
  for (int16_t& value : shifted.hu) value = static_cast<int16_t>(value + 400);
  report = PrepareValues({}, &shifted);
  ASSERT_TRUE(report.ok());
  EXPECT_TRUE(report->gray);
}

TEST(GrayValuesTest, RecipeTakesPrecedenceOverTheHistogram) {
  const CtVolume head = Head();
  CtVolume volume = head;
  volume.has_gray_values = true;  // as the reader says where the recipe does
  CtReadOptions options;
  options.values = CtValues::kGray;
  absl::StatusOr<CtValuesReport> report = PrepareValues(options, &volume);
  ASSERT_THAT(report.status(), IsOk());
  EXPECT_TRUE(report->gray);
  EXPECT_EQ(report->reason, "The recipe states that values are gray values.");

  volume = head;
  for (int16_t& value : volume.hu) value = static_cast<int16_t>(value + 400);
  const CtVolume shifted = volume;
  options.values = CtValues::kHu;
  report = PrepareValues(options, &volume);
  ASSERT_THAT(report.status(), IsOk());
  EXPECT_FALSE(report->gray);
  EXPECT_EQ(report->reason, "The recipe states that values are HU.");
  EXPECT_EQ(volume.hu, shifted.hu);
}

TEST(GrayValuesTest, WithoutBoneIsRefused) {
  CtVolume cone = Head();
  for (int16_t& value : cone.hu) value = std::min(value, int16_t{70});
  cone.has_gray_values = true;
  EXPECT_THAT(PrepareValues({}, &cone).status(),
              StatusIs(kInvalid, HasSubstr("do not show air, soft tissue and bone")));
}

}  // namespace
}  // namespace tissueform
