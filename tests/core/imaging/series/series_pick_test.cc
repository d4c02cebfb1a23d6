// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/series/series_pick.h"

#include <cmath>
#include <functional>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/imaging/series/image_header.h"
#include "core/imaging/series/series_objections.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using testing::StatusIs;

// A head in axial slices, as a scanner sends it.
std::vector<ImageHeader> Head(int slices = 200, double spacing_mm = 0.8) {
  std::vector<ImageHeader> images;
  for (int i = 0; i < slices; ++i) {
    ImageHeader image;
    image.class_uid = std::string(kCtImageClass);
    image.study_uid = "1.2.3";
    image.series_uid = "1.2.3.4";
    image.frame_uid = "1.2.3.5";
    image.modality = "CT";
    image.series_description = "Head PLANTED^PATRICIA";
    image.convolution_kernel = "H30s";
    image.image_type = "ORIGINAL\\PRIMARY\\AXIAL";
    image.series_number = 2;
    image.instance_number = i + 1;
    image.position_mm = Eigen::Vector3d(-100, -100, i * spacing_mm);
    image.axes = Eigen::Matrix<double, 3, 2>::Identity();
    image.slice_thickness_mm = spacing_mm;
    image.rescale_slope = 1;
    image.rescale_intercept = -1024;
    images.push_back(image);
  }
  return images;
}

SeriesFacts FactsAfter(const std::function<void(std::vector<ImageHeader>*)>& change) {
  std::vector<ImageHeader> images = Head();
  change(&images);
  return FactsOfSeries("key", images);
}

SeriesRule SomeRule() {
  SeriesRule rule;
  rule.name = "head";
  rule.recipe = "recipe.json";
  return rule;
}

TEST(SeriesFactsTest, MeasuresAHead) {
  const SeriesFacts facts = FactsOfSeries("key", Head());
  EXPECT_EQ(facts.slices, 200);
  EXPECT_NEAR(facts.spacing_mm, 0.8, 1e-9);
  EXPECT_NEAR(facts.coverage_mm, 160, 1e-6);
  EXPECT_EQ(facts.plane, SliceOrientation::kAxial);
  EXPECT_EQ(facts.kernel, KernelKind::kSoft);
  EXPECT_EQ(facts.missing, 0);
  EXPECT_EQ(facts.duplicates, 0);
  EXPECT_EQ(WhatIsAgainst(facts, SomeRule()), "");
}

TEST(SeriesFactsTest, KernelsOfManufacturersAreSoftOrSharp) {
  for (const char* kernel : {"H30s", "B30f", "STANDARD", "SOFT", "FC21", "Hr40f"}) {
    EXPECT_EQ(KernelKindOf(kernel), KernelKind::kSoft) << kernel;
  }
  for (const char* kernel : {"H60s", "B70h", "BONEPLUS", "EDGE", "FC81", "Hr59"}) {
    EXPECT_EQ(KernelKindOf(kernel), KernelKind::kBone) << kernel;
  }
  for (const char* kernel : {"", "YB", "4711"}) {
    EXPECT_EQ(KernelKindOf(kernel), KernelKind::kUnknown) << kernel;
  }
}

TEST(SeriesFactsTest, ATiltedGantryIsAxialAndAReformattedSeriesIsNot) {
  const auto turn = [](double degrees) {
    return FactsAfter([degrees](std::vector<ImageHeader>* images) {
      const double angle = degrees * M_PI / 180;
      for (ImageHeader& image : *images) {
        image.axes->col(1) = Eigen::Vector3d(0, std::cos(angle), -std::sin(angle));
      }
    });
  };
  EXPECT_EQ(turn(20).plane, SliceOrientation::kAxial);
  EXPECT_EQ(turn(90).plane, SliceOrientation::kCoronal);
  EXPECT_EQ(turn(45).plane, SliceOrientation::kOblique);
}

struct Defect {
  const char* name;
  std::function<void(std::vector<ImageHeader>*)> change;
  const char* said;
};

class DefectTest : public ::testing::TestWithParam<Defect> {};

TEST_P(DefectTest, IsReportedWithoutPatientData) {
  const SeriesFacts facts = FactsAfter(GetParam().change);
  const std::string against = WhatIsAgainst(facts, SomeRule());
  EXPECT_THAT(against, HasSubstr(GetParam().said));
  EXPECT_THAT(against, Not(HasSubstr("PLANTED")));
  EXPECT_THAT(DescribeFacts(facts), Not(HasSubstr("PLANTED")));
  EXPECT_FALSE(PickSeries({facts}, {SomeRule()}).front().chosen);
}

using Images = std::vector<ImageHeader>;

INSTANTIATE_TEST_SUITE_P(
    All, DefectTest,
    ::testing::Values(
        Defect{"MissingSlices", [](Images* i) { i->erase(i->begin() + 9, i->begin() + 12); },
               "3 slices are missing"},
        Defect{"DuplicateSlices", [](Images* i) { i->push_back(i->front()); },
               "1 images have the position of another one"},
        Defect{"MixedFrames", [](Images* i) { i->back().frame_uid = "9"; },
               "2 frames of reference"},
        Defect{"MixedOrientations",
               [](Images* i) { i->back().axes->col(1) = Eigen::Vector3d::UnitZ(); },
               "different orientations"},
        Defect{"Few", [](Images* i) { i->resize(20); }, "it has 20 slices, fewer than 60"},
        Defect{"Thick", [](Images* i) { i->front().slice_thickness_mm = 5; }, "5.00 mm thick"},
        Defect{"Scout",
               [](Images* i) {
                 for (ImageHeader& image : *i) image.image_type = "ORIGINAL\\PRIMARY\\LOCALIZER";
               },
               "localizer"},
        Defect{"SomeWithoutHounsfield", [](Images* i) { (*i)[7].rescale_slope.reset(); },
               "1 of its 200 images have no Hounsfield calibration"},
        Defect{"MultiFrame",
               [](Images* i) {
                 for (ImageHeader& image : *i) {
                   image.class_uid = std::string(kEnhancedCtImageClass);
                   image.rescale_slope.reset();
                   image.position_mm.reset();
                 }
               },
               "multi-frame (Enhanced CT)"},
        Defect{"Derived", [](Images* i) { i->front().image_type = "DERIVED\\SECONDARY"; },
               "derived"},
        Defect{"Magnetic", [](Images* i) { i->front().modality = "MR"; }, "no Hounsfield units"},
        Defect{"HostileModality", [](Images* i) { i->front().modality = "PLANTED\nx"; },
               "its modality is unknown"},
        Defect{"ConeBeam",
               [](Images* i) {
                 for (ImageHeader& image : *i) image.rescale_slope.reset();
               },
               "cone-beam"},
        Defect{"NoPlaces",
               [](Images* i) {
                 for (ImageHeader& image : *i) image.position_mm.reset();
               },
               "it has 0 slices"}),
    [](const auto& defect) { return std::string(defect.param.name); });

struct Stranger {
  const char* name;
  std::function<void(ImageHeader*)> change;
};

class StrangerTest : public ::testing::TestWithParam<Stranger> {};

TEST_P(StrangerTest, IsSetAsideInASeriesOfCtSlicesWithANote) {
  for (const bool comes_first : {false, true}) {
    const SeriesFacts facts = FactsAfter([comes_first](Images* images) {
      ImageHeader stranger = images->front();
      GetParam().change(&stranger);
      images->insert(comes_first ? images->begin() : images->end(), stranger);
    });
    EXPECT_EQ(facts.set_aside, 1);
    EXPECT_EQ(facts.modality, "CT");
    EXPECT_EQ(WhatIsAgainst(facts, SomeRule()), "");
    const SeriesVerdict verdict = PickSeries({facts}, {SomeRule()}).front();
    EXPECT_TRUE(verdict.chosen);
    EXPECT_THAT(verdict.reason, HasSubstr("200 axial slices"));
    EXPECT_THAT(verdict.reason, HasSubstr("ignored: 1 other object"));
  }
}

void MakeCapture(ImageHeader* object) {
  *object = {.study_uid = object->study_uid,
             .series_uid = object->series_uid,
             .class_uid = "1.2.840.10008.5.1.4.1.1.7",
             .modality = "OT",
             .image_type = "DERIVED\\SECONDARY"};
}

INSTANTIATE_TEST_SUITE_P(All, StrangerTest,
                         ::testing::Values(Stranger{"Capture", MakeCapture},
                                           Stranger{"Report",
                                                    [](ImageHeader* object) {
                                                      MakeCapture(object);
                                                      object->class_uid =
                                                          "1.2.840.10008.5.1.4.1.1.88.67";
                                                      object->modality = "SR";
                                                    }},
                                           Stranger{"Scout",
                                                    [](ImageHeader* object) {
                                                      object->image_type =
                                                          "ORIGINAL\\PRIMARY\\LOCALIZER";
                                                      object->frame_uid = "9";
                                                      object->axes->col(1) =
                                                          Eigen::Vector3d::UnitZ();
                                                    }}),
                         [](const auto& stranger) { return std::string(stranger.param.name); });

TEST(SeriesFactsTest, WithoutCtSlicesTheMostFrequentKindCounts) {
  const SeriesFacts facts = FactsAfter([](Images* images) {
    for (ImageHeader& image : *images) {
      image.class_uid = "1.2.840.10008.5.1.4.1.1.4";
      image.modality = "MR";
    }
    MakeCapture(&images->front());
  });
  EXPECT_EQ(facts.set_aside, 1);
  EXPECT_THAT(WhatIsAgainst(facts, SomeRule()), HasSubstr("modality is MR"));
}

TEST(PickSeriesTest, TheSofterKernelWinsAndTheOtherVerdictStatesWhy) {
  SeriesFacts sharp = FactsAfter([](Images* images) {
    for (ImageHeader& image : *images) image.convolution_kernel = "H60s";
  });
  const std::vector<SeriesVerdict> verdicts =
      PickSeries({sharp, FactsOfSeries("soft", Head())}, {SomeRule()});
  EXPECT_FALSE(verdicts[0].chosen);
  EXPECT_EQ(verdicts[0].reason, "the chosen series has a softer kernel");
  EXPECT_TRUE(verdicts[1].chosen);
  EXPECT_THAT(verdicts[1].reason, HasSubstr("by rule \"head\": 200 axial slices"));
}

TEST(PickSeriesTest, AnEarlierRuleGoesBeforeABetterSeries) {
  SeriesRule sharp_first = SomeRule();
  sharp_first.description_has = {"sharp"};
  SeriesFacts sharp = FactsOfSeries("a", Head());
  sharp.description = "Head SHARP";
  sharp.kernel = KernelKind::kBone;
  const auto verdicts = PickSeries({FactsOfSeries("b", Head()), sharp}, {sharp_first, SomeRule()});
  EXPECT_FALSE(verdicts[0].chosen);
  EXPECT_TRUE(verdicts[1].chosen);
  EXPECT_EQ(verdicts[1].rule, 0);
}

TEST(PickSeriesTest, ChoosesNothingWithoutSeriesOrRules) {
  EXPECT_TRUE(PickSeries({}, {SomeRule()}).empty());
  EXPECT_FALSE(PickSeries({FactsOfSeries("a", Head())}, {}).front().chosen);
}

TEST(SeriesRulesTest, RuleOverridesOnlyTheGivenDefaults) {
  const auto rules = ParseSeriesRules(
      R"({"format": "tissueform-series-rules", "version": 1, "rules": [
          {"name": "thin", "recipe": "a/recipe.json", "max_spacing_mm": 0.7, "contrast": false,
           "prefer": ["bone_kernel", "more_coverage"]}]})",
      "/etc/tissueform");
  ASSERT_THAT(rules, testing::IsOk());
  ASSERT_EQ(rules->size(), 1);
  const SeriesRule& rule = rules->front();
  EXPECT_EQ(rule.recipe, "/etc/tissueform/a/recipe.json");
  EXPECT_EQ(rule.max_spacing_mm, 0.7);
  EXPECT_FALSE(rule.contrast);
  EXPECT_EQ(rule.min_slices, 60);
  EXPECT_THAT(rule.prefer, ::testing::ElementsAre(SeriesPreference::kBoneKernel,
                                                  SeriesPreference::kMoreCoverage));
}

TEST(SeriesRulesTest, WrongRulesAreRefusedByTheirPlace) {
  for (
      const char* text :
      {"{", "{}", R"({"format": "tissueform-series-rules", "version": 1, "rules": []})",
       R"({"format": "tissueform-series-rules", "version": 1, "rules": [{"name": "x"}]})",
       R"({"format": "tissueform-series-rules", "version": 1, "rules": [{"recipe": "r", "ct": 1}]})",
       R"({"format": "tissueform-series-rules", "version": 1, "rules": [{"recipe": "r",
            "prefer": ["nicest"]}]})"}) {
    EXPECT_THAT(ParseSeriesRules(text, "").status(), StatusIs(absl::StatusCode::kInvalidArgument))
        << text;
  }
}

}  // namespace
}  // namespace tissueform
