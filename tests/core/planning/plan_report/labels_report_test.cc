// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/labels_report.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

PlanLabels SomeLabels() {
  PlanLabels labels;
  labels.format = "NIfTI";
  LabelSegment known;
  known.value = 2;
  known.structure = Structure::kLowerJaw;
  LabelSegment unknown;
  unknown.name = "somebody";
  labels.segments = {known, unknown};
  labels.notes = {"A note."};
  labels.fit.has_bone = true;
  labels.fit.on_bone = 0.9;
  labels.agreement.bone_in_labels = 0.8;
  labels.agreement.structures = {{"lower jaw with teeth", 50e3, 52e3, 0.95}};
  return labels;
}

TEST(LabelsReportTest, HasTheDiceCoefficientsAndOnlyKnownSegments) {
  const PlanLabels labels = SomeLabels();
  EXPECT_THAT(LabelsText(labels), AllOf(HasSubstr("lower jaw with teeth: Dice 0.950"),
                                        HasSubstr("90 % of the"), HasSubstr("A note.")));
  const nlohmann::ordered_json json = LabelsJson(labels);
  EXPECT_EQ(json["agreement"][0]["dice"], 0.95);
  ASSERT_EQ(json["segments"].size(), 1U);
  EXPECT_EQ(json["segments"][0]["structure"], "mandible");
  EXPECT_THAT(json.dump(), Not(HasSubstr("somebody")));
  EXPECT_THAT(LabelsCautions(labels), IsEmpty());
  EXPECT_TRUE(LabelsJson(std::nullopt).is_null());
}

TEST(LabelsReportTest, CautionsSayWhereLabelsAndCtDisagree) {
  PlanLabels labels = SomeLabels();
  labels.agreement.structures[0].dice = 0.6;
  labels.agreement.bone_in_labels = 0.3;
  EXPECT_THAT(LabelsCautions(labels),
              ElementsAre(HasSubstr("disagree on the lower jaw with teeth (Dice 0.60)"),
                          HasSubstr("Only 30 % of the jaws' bone")));
}

}  // namespace
}  // namespace tissueform
