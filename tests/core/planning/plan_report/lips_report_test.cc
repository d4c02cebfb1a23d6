// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/lips_report.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(LipsReportTest, ReportsClosedLipsWithPlaceAndSize) {
  const LipContact contact{
      .examined_mm = 31, .width_mm = 24, .area_mm2 = 192, .depth_mm = 8, .place_mm = {12, -60, 31}};
  EXPECT_THAT(LipsCautions(contact), ElementsAre(AllOf(HasSubstr("24"), HasSubstr("192 mm2"),
                                                       HasSubstr("(12, -60, 31) mm"))));
  EXPECT_EQ(LipsJson(contact, false)["joined_mm2"], 192);
  EXPECT_EQ(LipsJson(contact, false)["joined_at_mm"][2], 31);
}

TEST(LipsReportTest, PartedLipsNeedNoCaution) {
  LipContact contact;
  contact.examined_mm = 31;
  EXPECT_THAT(LipsCautions(contact), IsEmpty());
  EXPECT_FALSE(LipsJson(contact, false).contains("joined_at_mm"));
}

}  // namespace
}  // namespace tissueform
