// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "proto/conversion/model_conversion.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::tissueform::testing::StatusIs;

using ::tissueform::testing::kInvalid;

TEST(ModelConversionTest, EveryModelSurvivesTheJourney) {
  for (const DeformationModel model :
       {DeformationModel::kGradientField, DeformationModel::kArap, DeformationModel::kLinearElastic,
        DeformationModel::kNeoHookean}) {
    ASSERT_OK_AND_ASSIGN(const DeformationModel back,
                         ToModel(ToProto(model), DeformationModel::kGradientField));
    EXPECT_EQ(back, model);
  }
}

TEST(ModelConversionTest, UnspecifiedModelIsTheFallback) {
  ASSERT_OK_AND_ASSIGN(const DeformationModel model,
                       ToModel(v1::DEFORMATION_MODEL_UNSPECIFIED, DeformationModel::kArap));
  EXPECT_EQ(model, DeformationModel::kArap);
}

TEST(ModelConversionTest, UnspecifiedSettingsAreTheDefaults) {
  ASSERT_OK_AND_ASSIGN(const GradientFieldOptions options, ToGradientFieldOptions({}, 1000));
  const GradientFieldOptions defaults;
  EXPECT_EQ(options.rotation, defaults.rotation);
  EXPECT_EQ(options.guidance, defaults.guidance);
  EXPECT_EQ(options.blend, defaults.blend);
  EXPECT_EQ(options.max_iterations, defaults.max_iterations);
  EXPECT_EQ(options.tolerance_mm, defaults.tolerance_mm);
}

TEST(ModelConversionTest, RefusesUnknownOrExcessiveSettingsByName) {
  EXPECT_THAT(ToModel(static_cast<v1::DeformationModel>(9), DeformationModel::kArap),
              StatusIs(kInvalid, HasSubstr("model 9")));
  v1::GradientFieldSettings settings;
  settings.set_guidance(static_cast<v1::Guidance>(9));
  EXPECT_THAT(ToGradientFieldOptions(settings, 1000), StatusIs(kInvalid, HasSubstr("guidance 9")));
  settings.Clear();
  settings.set_blend(static_cast<v1::BlendMap>(9));
  EXPECT_THAT(ToGradientFieldOptions(settings, 1000), StatusIs(kInvalid, HasSubstr("blend 9")));
  settings.Clear();
  settings.set_max_iterations(1001);
  EXPECT_THAT(ToGradientFieldOptions(settings, 1000), StatusIs(kInvalid, HasSubstr("1001")));
}

}  // namespace
}  // namespace tissueform
