// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/cautions.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/core/planning/plan_report/plan_build_of_mesh.h"

namespace tissueform {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

// A CT that begins at z = -101 mm, with the chin at -60 mm.
PlanBuild WholeHead() {
  PlanBuild build = testing::PlanBuildOfMesh();
  build.head.hu.geometry = {.size = {10, 10, 10}, .origin_mm = {0, 0, -100}, .spacing_mm = 2};
  build.landmarks.menton = {0, 0, -60};
  build.landmarks.nose_prominence_mm = 9;
  return build;
}

TEST(CautionsTest, CompleteHeadNeedsNoCaution) { EXPECT_THAT(Cautions(WholeHead()), IsEmpty()); }

TEST(CautionsTest, ReportsAMissingNoseAndChin) {
  PlanBuild build = WholeHead();
  build.landmarks.nose_prominence_mm = 0.24;
  EXPECT_THAT(Cautions(build), ElementsAre(HasSubstr("is 0.2 mm in front of")));
  build.landmarks.menton.z() = -97;
  EXPECT_THAT(Cautions(build),
              ElementsAre(HasSubstr("nose"), HasSubstr("ends 4 mm below the bony chin")));
}

// The margin of the grid about the surfaces is not head.
TEST(CautionsTest, CautionsForSurfacesDoNotMentionACt) {
  PlanBuild build = WholeHead();
  build.surface_roles = {"skin", "skull", "lower jaw"};
  build.head.head = LabelGrid(build.head.hu.geometry);
  build.head.head.At(5, 5, 8) = 1;  // z = -84 mm
  EXPECT_THAT(Cautions(build), IsEmpty());
  build.landmarks.nose_prominence_mm = 0.24;
  build.landmarks.menton.z() = -81;
  EXPECT_THAT(Cautions(build), ElementsAre(HasSubstr("flattened in these surfaces"),
                                           HasSubstr("The skin ends 4 mm below the bony chin")));
  build.coverage.cuts.resize(1);
  build.coverage.cuts[0].region_mm2.assign(kNamedSkinRegions.size() + 1, 100);
  EXPECT_THAT(Cautions(build), Each(Not(HasSubstr("CT"))));
  EXPECT_THAT(Cautions(build), ElementsAre(HasSubstr("An opening of the skin cuts the face"),
                                           HasSubstr("The surfaces do not contain the whole nose"),
                                           HasSubstr("4 mm")));
}

TEST(CautionsTest, ReportsAChinThatTheBorderCuts) {
  PlanBuild build = WholeHead();
  build.landmarks.menton.z() = -100;
  build.parts.cut_off_mm = 1.44;
  EXPECT_THAT(Cautions(build), ElementsAre(HasSubstr("about 1.4 mm of its bone")));
}

TEST(CautionsTest, ReportsTetsThatStayInverted) {
  PlanBuild build = WholeHead();
  build.num_inverted = 3;
  EXPECT_THAT(Cautions(build), ElementsAre(HasSubstr("3 tets are inverted")));
}

TEST(CautionsTest, ReportsSeparatedTeethUnlessTheRecipeGivesTheCut) {
  PlanBuild build = WholeHead();
  build.parts.separation = JawSeparation::kAutomaticCut;
  EXPECT_THAT(Cautions(build), ElementsAre(HasSubstr("teeth touch")));
  build.parts.separation = JawSeparation::kGivenCut;
  EXPECT_THAT(Cautions(build), IsEmpty());
}

}  // namespace
}  // namespace tissueform
