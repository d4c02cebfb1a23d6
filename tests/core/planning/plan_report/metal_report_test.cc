// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/metal_report.h"

#include <algorithm>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/core/planning/plan_report/plan_build_of_mesh.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Two fillings 10 mm apart in height and one beside the first, in a head of 20 mm that is white
// where it was corrected and black before.
PlanBuild WithMetal() {
  PlanBuild build = testing::PlanBuildOfMesh();
  const GridGeometry grid = {.size = {10, 10, 10}, .origin_mm = {0, 0, 0}, .spacing_mm = 2};
  build.head.hu = HuGrid(grid, 900);
  build.before_correction = HuGrid(grid, -300);
  build.metal.clusters = {{.volume_mm3 = 400, .centre_mm = {5, 5, 4}},
                          {.volume_mm3 = 300, .centre_mm = {15, 5, 5}},
                          {.volume_mm3 = 200, .centre_mm = {5, 5, 14}}};
  build.metal.volume_mm3 = 900;
  build.metal.low_z_mm = 2;
  build.metal.high_z_mm = 16;
  build.metal.corrected_slices = 8;
  return build;
}

TEST(MetalReportTest, MouthWithoutMetalNeedsNoCaution) {
  const PlanBuild build = testing::PlanBuildOfMesh();
  EXPECT_THAT(MetalCautions(build), IsEmpty());
  EXPECT_FALSE(MetalJson(build)["found"].get<bool>());
  EXPECT_THAT(DrawMetalSlices(build).before, IsEmpty());
}

TEST(MetalReportTest, CautionStatesAmountAndPlaceOfMetal) {
  EXPECT_THAT(MetalCautions(WithMetal()),
              ElementsAre(HasSubstr("3 pieces of 0.9 cm3 together, from z = 2.0 to 16.0 mm. Its "
                                    "artifacts were reduced in 8 slices")));
}

TEST(MetalReportTest, MuchMetalAsksForPlanes) {
  PlanBuild build = WithMetal();
  build.metal.volume_mm3 = 4000;
  EXPECT_THAT(MetalCautions(build),
              ElementsAre(HasSubstr("4.0 cm3"), HasSubstr("Set \"occlusal_plane\"")));
}

TEST(MetalReportTest, TheReportHasEveryPiece) {
  const nlohmann::ordered_json json = MetalJson(WithMetal());
  EXPECT_EQ(json["volume_mm3"], 900);
  EXPECT_EQ(json["pieces"].size(), 3U);
  EXPECT_EQ(json["pieces"][1]["volume_mm3"], 300);
}

TEST(MetalReportTest, SlicesShowBeforeAndAfterAndNoHeightTwice) {
  const MetalSlices slices = DrawMetalSlices(WithMetal());
  ASSERT_EQ(slices.before.size(), 2U);
  ASSERT_EQ(slices.after.size(), 2U);
  const auto all = [](const Picture& picture, uint8_t value) {
    return !picture.rgb.empty() &&
           std::all_of(picture.rgb.begin(), picture.rgb.end(),
                       [value](uint8_t channel) { return channel == value; });
  };
  EXPECT_TRUE(all(slices.before[0], 0));
  EXPECT_TRUE(all(slices.after[1], 255));
}

}  // namespace
}  // namespace tissueform
