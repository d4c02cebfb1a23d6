// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/objects_report.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/planning/plan_report/cautions.h"
#include "tests/core/planning/plan_report/plan_build_of_mesh.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Above z = 0 is the region of interest; a thing lies on both sides of its border, with 30 faces of
// 4 mm2 within it.
PlanBuild HeadUnder(ObjectKind kind) {
  PlanBuild build = testing::PlanBuildOfMesh();
  build.soft_tissue.region = {{{0, 500, 0}, -Eigen::Vector3d::UnitY()},
                              {{0, 0, 500}, -Eigen::Vector3d::UnitZ()},
                              {{0, 0, 0}, Eigen::Vector3d::UnitZ()}};
  AttachedObject object{
      .kind = kind, .volume_mm3 = 1900, .middle_mm = {5, 0, 10}, .contact_mm = {}, .face_mm2 = 4};
  for (int k = -10; k < 30; ++k) object.contact_mm.emplace_back(5, -7, k + 0.5);
  build.head.objects = {object};
  return build;
}

TEST(ObjectsReportTest, ReportsTheSkinUnderATubeWithPlaceAndSize) {
  const PlanBuild build = HeadUnder(ObjectKind::kTube);
  EXPECT_THAT(ObjectsCautions(build),
              ElementsAre(AllOf(HasSubstr("A tube"), HasSubstr("1.9 cm3"), HasSubstr("0.8 cm2"),
                                HasSubstr("(5, -7, 0) and (5, -7, 30) mm"))));
  EXPECT_THAT(Cautions(build), Contains(HasSubstr("A tube")));
  EXPECT_EQ(ObjectsJson(build)[0]["kind"], "tube");
  EXPECT_EQ(ObjectsJson(build)[0]["skin_under_it_mm2"], 80);
  EXPECT_EQ(ObjectsJson(build)[0]["skin_under_it_at_mm"][2], 15);
  EXPECT_TRUE(CheckObjects(build).passed);
}

TEST(ObjectsReportTest, APieceThatMayBeFaceKeepsThePlanFromBeingReady) {
  const PlanBuild build = HeadUnder(ObjectKind::kUnknown);
  EXPECT_FALSE(CheckObjects(build).passed);
  EXPECT_THAT(CheckObjects(build).measured, HasSubstr("0.8 cm2 at (5, -7, 15) mm"));
  EXPECT_FALSE(AllPassed(CheckQuality(build, MeasurePlan(build))));
  EXPECT_THAT(FailedText(CheckQuality(build, MeasurePlan(build))), HasSubstr("may be face"));
}

TEST(ObjectsReportTest, ObjectsOutsideTheRegionOfInterestAreListedOnly) {
  PlanBuild build = HeadUnder(ObjectKind::kUnknown);
  build.soft_tissue.region.below.point_mm.z() = 40;
  EXPECT_TRUE(CheckObjects(build).passed);
  EXPECT_THAT(ObjectsCautions(build), IsEmpty());
  EXPECT_EQ(ObjectsJson(build)[0]["skin_under_it_mm2"], 0);
}

}  // namespace
}  // namespace tissueform
