// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/coverage_report.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

SkinCoverage WithNose(double covered_mm2) {
  SkinCoverage coverage;
  coverage.tolerance_mm = 1.5;
  CoveredPart& nose = coverage.regions[static_cast<size_t>(SkinRegion::kNose)];
  nose = {.area_mm2 = 2000,
          .covered_mm2 = covered_mm2,
          .largest_mm = 13.3,
          .farthest = {-96.4, 17, -6}};
  coverage.whole = nose;
  coverage.whole.area_mm2 = 30000;
  coverage.whole.covered_mm2 = 28000 + covered_mm2;
  return coverage;
}

std::vector<bool> Passed(const SkinCoverage& coverage) {
  std::vector<bool> passed;
  for (const QualityCheck& check : CheckCoverage(coverage)) passed.push_back(check.passed);
  return passed;
}

TEST(CoverageReportTest, AFaceWithoutGapsPassesWithoutACaution) {
  EXPECT_THAT(Passed(WithNose(1981)), ElementsAre(true, true, true, true));
  EXPECT_THAT(CoverageCautions(WithNose(1981)), IsEmpty());
  EXPECT_EQ(CoverageJson(WithNose(1981))["regions"]["nose"]["covered_share"], 1981.0 / 2000);
}

TEST(CoverageReportTest, ReportsMissingSkinAsHairOrClothWhereItIsLooserThanFat) {
  SkinCoverage coverage = WithNose(1900);
  EXPECT_THAT(CoverageCautions(coverage), ElementsAre(Not(HasSubstr("cloth"))));
  coverage.regions[static_cast<size_t>(SkinRegion::kNose)].hu_behind_missing = -446;
  EXPECT_THAT(CoverageCautions(coverage),
              ElementsAre(AllOf(HasSubstr("5.0 % of the nose"), HasSubstr("-446 HU"),
                                HasSubstr("hair or cloth"))));
  EXPECT_THAT(Passed(coverage), ElementsAre(true, false, true, true));
}

TEST(CoverageReportTest, ARegionCannotHideInTheWhole) {
  const SkinCoverage coverage = WithNose(1979);
  EXPECT_THAT(Passed(coverage), ElementsAre(true, false, true, true));
  EXPECT_THAT(CheckCoverage(coverage)[1].measured, HasSubstr("98.95 % in the nose"));
  EXPECT_THAT(CoverageCautions(coverage),
              ElementsAre(AllOf(HasSubstr("1.0 % of the nose"), HasSubstr("0.2 of 20.0 cm2"),
                                HasSubstr("13.3 mm at (-96, 17, -6) mm"))));
}

ScannerCut CutOf(SkinRegion region, double mm2) {
  ScannerCut cut;
  cut.area_mm2 = mm2 + 200;
  cut.region_mm2.assign(kNamedSkinRegions.size() + 1, 0);
  cut.region_mm2[0] = 200;
  cut.region_mm2[static_cast<size_t>(region)] += mm2;
  cut.middle = {1, 2, 3};
  cut.low = {0, 1, 2};
  cut.high = {2, 3, 4};
  return cut;
}

TEST(CoverageReportTest, ReportsACutByTheScannersCircleWithoutFailing) {
  SkinCoverage coverage = WithNose(2000);
  coverage.cuts = {CutOf(SkinRegion::kNose, 345), CutOf(SkinRegion::kNone, 12)};
  EXPECT_THAT(Passed(coverage), ElementsAre(true, true, true, true));
  EXPECT_THAT(
      CutCautions(coverage),
      ElementsAre(AllOf(HasSubstr("at 2 places, 757 mm2 in all; the largest at (1, 2, 3) mm: "
                                  "545 mm2, between (0, 1, 2) mm and (2, 3, 4) mm"),
                        HasSubstr("evaluated: at the nose (345 mm2)"))));
  EXPECT_TRUE(NoseIsCut(coverage));
  coverage.cuts.erase(coverage.cuts.begin());
  EXPECT_FALSE(NoseIsCut(coverage));
  EXPECT_THAT(CutCautions(coverage),
              ElementsAre(AllOf(HasSubstr("cuts the face at (1, 2, 3) mm: 212"),
                                Not(HasSubstr("front of the face")))));
  EXPECT_EQ(CoverageJson(coverage)["cut_by_scanner"].size(), 1U);
}

TEST(CoverageReportTest, ReportsGapsAndHolesWithTheirPlace) {
  SkinCoverage coverage = WithNose(2000);
  coverage.holes = {{SkinRegion::kLeftCheek, 72, 6.5, {1, 2, 3}, -320},
                    {SkinRegion::kChin, 9, 2.6, {4, 5, 6}}};
  EXPECT_THAT(Passed(coverage), ElementsAre(true, true, true, false));
  EXPECT_THAT(CoverageCautions(coverage),
              ElementsAre(AllOf(HasSubstr("0.7 cm2 of the left cheek"),
                                HasSubstr("up to 6.5 mm at (1, 2, 3) mm"),
                                HasSubstr("-320 HU on average, less than fat"))));
  coverage.gaps = {{SkinRegion::kLeftCheek, 51, 6.5, {1, 2, 3}}};
  EXPECT_THAT(Passed(coverage), ElementsAre(true, true, false, false));
  coverage.gaps[0].area_mm2 = 49;
  EXPECT_THAT(Passed(coverage), ElementsAre(true, true, true, false));
}

TEST(CoverageReportTest, ReportsBoneInTheSkin) {
  SkinCoverage coverage = WithNose(2000);
  coverage.mesh_skin_mm2 = 30000;
  coverage.mesh_skin_on_bone_mm2 = 200;
  EXPECT_THAT(CoverageCautions(coverage), IsEmpty());
  coverage.mesh_skin_on_bone_mm2 = 900;
  EXPECT_THAT(CoverageCautions(coverage),
              ElementsAre(AllOf(HasSubstr("3.0 %"), HasSubstr("9.0 cm2"))));
}

TEST(CoverageReportTest, MissingSkinIsRedInThePicture) {
  SkinCoverage coverage = WithNose(2000);
  coverage.positions = Positions::Zero(3, 3);
  coverage.triangles = TriangleIndices{{0, 1, 2}, {0, 2, 1}, {1, 2, 0}};
  coverage.distance_mm = {1.4, 1.6, 9};
  const std::vector<LegendEntry> legend = CoverageLegend(coverage);
  for (const Scene& scene : CoverageScenes(coverage)) {
    ASSERT_EQ(scene.surfaces.size(), 1U);
    EXPECT_THAT(scene.surfaces[0].triangle_colours,
                ElementsAre(legend[0].colour, legend[1].colour, legend[2].colour));
  }
}

}  // namespace
}  // namespace tissueform
