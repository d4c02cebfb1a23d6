// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/recipe.h"

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mesh/payload/sha256.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::StatusIs;

using ::tissueform::testing::kInvalid;

// A recipe with these further keys.
std::string WithKeys(const std::string& keys) {
  return R"({"format": "tissueform-recipe", "version": 1,
             "segments": [{"name": "mandible", "osteotomy": "bssro"}])" +
         (keys.empty() ? "" : ", " + keys) + "}";
}

absl::StatusOr<Recipe> Parse(const std::string& keys) { return ParseRecipe(WithKeys(keys), "r"); }

TEST(RecipeTest, SegmentsAreEnough) {
  ASSERT_OK_AND_ASSIGN(const Recipe recipe, Parse(""));
  ASSERT_EQ(recipe.segments.size(), 1U);
  EXPECT_EQ(recipe.segments[0].kind, OsteotomyKind::kBssro);
  EXPECT_TRUE(recipe.segments[0].planes.empty());
  EXPECT_EQ(recipe.spacing_mm, 1.5);
  EXPECT_FALSE(recipe.ct.hu_offset.has_value());
}

TEST(RecipeTest, KeepsTheDigestOfTheTextThatWasParsed) {
  const std::string text = WithKeys("");
  ASSERT_OK_AND_ASSIGN(const Recipe recipe, ParseRecipe(text, "r"));
  EXPECT_EQ(recipe.sha256, Sha256Hex({text}));
  ASSERT_OK_AND_ASSIGN(const Recipe spaced, ParseRecipe(text + "\n", "r"));
  EXPECT_EQ(spaced.sha256, Sha256Hex({text + "\n"}));
}

TEST(RecipeTest, EveryKeyArrives) {
  ASSERT_OK_AND_ASSIGN(const Recipe recipe,
                       ParseRecipe(R"({"format": "tissueform-recipe", "version": 1,
        "ct": {"hu_offset": -1024, "axes": "RPI", "series_number": 3},
        "spacing_mm": 2,
        "segmentation": {"tissue_above_hu": -400, "bone_above_hu": 300,
                         "opening_radius_mm": 5, "smallest_bone_mm3": 99},
        "occlusal_plane": {"point_mm": [1, 2, 3], "normal": [0, 0, 2]},
        "segments": [
          {"name": "maxilla", "osteotomy": "le_fort_1",
           "planes": [{"point_mm": [0, 0, 5], "normal": [0, 3, 4]}],
           "pose": {"rotation_vector_deg": [180, 0, 0], "translation_mm": [0, -5, 1]}},
          {"name": "chin", "osteotomy": "genioplasty"}],
        "region_of_interest": {"below": {"point_mm": [0, 0, -70], "normal": [0, 0, 1]}},
        "soft_tissue": {"thinnest_mm": 4, "narrowest_neck_mm": 20, "smallest_cavity_mm3": 50},
        "mesh": {"edge_mm": 4, "fine_edge_mm": 2, "interior_edge_factor": 2,
                 "min_dihedral_deg": 8},
        "contact_band_mm": 7,
        "tissues": [{"name": "fat", "hu_below": -10, "youngs_modulus_pa": 1000},
                    {"name": "rest", "youngs_modulus_pa": 2000, "source": "a book"}],
        "poisson_ratio": 0.4, "model": "linear_elastic"})",
                                   "r"));
  EXPECT_EQ(recipe.ct.hu_offset, -1024);
  EXPECT_EQ(recipe.ct.axes, "RPI");
  EXPECT_EQ(recipe.ct.series_number, 3);
  EXPECT_EQ(recipe.spacing_mm, 2);
  EXPECT_EQ(recipe.segmentation.tissue_above_hu, -400);
  EXPECT_EQ(recipe.segmentation.bone_above_hu, 300);
  EXPECT_EQ(recipe.segmentation.opening_radius_mm, 5);
  EXPECT_EQ(recipe.segmentation.smallest_bone_mm3, 99);
  EXPECT_EQ(recipe.occlusal_plane->normal, Eigen::Vector3d(0, 0, 1));
  ASSERT_EQ(recipe.segments.size(), 2U);
  EXPECT_TRUE(recipe.segments[0].planes[0].normal.isApprox(Eigen::Vector3d(0, 0.6, 0.8), 1e-15));
  EXPECT_NEAR(recipe.segments[0].pose.rotation_vector.x(), 3.14159265358979, 1e-12);
  EXPECT_EQ(recipe.segments[0].pose.translation_mm, Eigen::Vector3d(0, -5, 1));
  EXPECT_EQ(recipe.segments[1].kind, OsteotomyKind::kGenioplasty);
  EXPECT_FALSE(recipe.back.has_value());
  EXPECT_EQ(recipe.below->point_mm.z(), -70);
  EXPECT_EQ(recipe.soft_tissue.thinnest_mm, 4);
  EXPECT_EQ(recipe.soft_tissue.narrowest_neck_mm, 20);
  EXPECT_EQ(recipe.soft_tissue.smallest_cavity_mm3, 50);
  EXPECT_EQ(recipe.mesh.edge_mm, 4);
  EXPECT_EQ(recipe.mesh.fine_edge_mm, 2);
  EXPECT_EQ(recipe.mesh.interior_edge_factor, 2);
  EXPECT_EQ(recipe.mesh.min_dihedral_deg, 8);
  EXPECT_EQ(recipe.contact_band_mm, 7);
  ASSERT_EQ(recipe.tissues.size(), 2U);
  EXPECT_EQ(recipe.tissues[0].hu_below, -10);
  EXPECT_EQ(recipe.tissues[0].youngs_modulus_pa, 1000);
  EXPECT_EQ(recipe.tissues[1].source, "a book");
  EXPECT_EQ(recipe.poisson_ratio, 0.4);
  EXPECT_EQ(recipe.model, DeformationModel::kLinearElastic);
}

TEST(RecipeTest, AWrittenRecipeIsReadBackUnchanged) {
  ASSERT_OK_AND_ASSIGN(const Recipe recipe,
                       Parse(R"("occlusal_plane": {"point_mm": [1, 2, 3], "normal": [0, 0.6, 0.8]},
               "contact_band_mm": 3.5)"));
  const std::string text = RecipeToJson(recipe);
  ASSERT_OK_AND_ASSIGN(const Recipe again, ParseRecipe(text, "again"));
  EXPECT_EQ(RecipeToJson(again), text);
}

TEST(RecipeTest, UnknownKeysAreNamed) {
  EXPECT_THAT(Parse(R"("spacing": 2)"),
              StatusIs(kInvalid, ::testing::AllOf(HasSubstr("recipe r"), HasSubstr("spacing"))));
  EXPECT_THAT(Parse(R"("mesh": {"edge": 2})"), StatusIs(kInvalid, HasSubstr("/mesh")));
}

TEST(RecipeTest, SenselessValuesAreRefused) {
  EXPECT_THAT(Parse(R"("spacing_mm": 0)"), StatusIs(kInvalid, HasSubstr("/spacing_mm")));
  EXPECT_THAT(Parse(R"("poisson_ratio": 0.5)"), StatusIs(kInvalid, HasSubstr("/poisson_ratio")));
  EXPECT_THAT(Parse(R"("ct": {"axes": "XYZ"})"), StatusIs(kInvalid, HasSubstr("/ct/axes")));
  EXPECT_THAT(Parse(R"("occlusal_plane": {"point_mm": [0, 0, 0], "normal": [0, 0, 0]})"),
              StatusIs(kInvalid, HasSubstr("no length")));
  EXPECT_THAT(Parse(R"("mesh": {"edge_mm": 2, "fine_edge_mm": 3})"),
              StatusIs(kInvalid, HasSubstr("fine_edge_mm")));
  EXPECT_THAT(Parse(R"("tissues": [{"name": "a", "hu_below": 5, "youngs_modulus_pa": 1}])"),
              StatusIs(kInvalid, HasSubstr("hu_below")));
}

TEST(RecipeTest, LabelsAreOfVersion5AndTheFileNameIsNotPassedOn) {
  const auto parse = [](const std::string& version, const std::string& labels) {
    return ParseRecipe(R"({"format": "tissueform-recipe", "version": )" + version +
                           R"(, "segments": [{"name": "chin", "osteotomy": "genioplasty"}], )" +
                           R"("labels": )" + labels + "}",
                       "r");
  };
  ASSERT_OK_AND_ASSIGN(const Recipe given,
                       parse("5", R"({"file": "smith.nii.gz", "convention": "totalsegmentator",
                                      "names": {"mandible": ["lower jaw", 2], "tube": [9]}})"));
  EXPECT_EQ(given.labels.file, "smith.nii.gz");
  EXPECT_EQ(given.labels.convention, "totalsegmentator");
  ASSERT_EQ(given.labels.names.size(), 3U);
  EXPECT_EQ(given.labels.names[0].structure, Structure::kLowerJaw);
  EXPECT_EQ(given.labels.names[0].name, "lower jaw");
  EXPECT_EQ(given.labels.names[1].value, 2);
  EXPECT_EQ(given.labels.names[2].structure, Structure::kTube);
  const std::string written = RecipeToJson(given);
  EXPECT_THAT(written, HasSubstr("\"version\": 5"));
  EXPECT_THAT(written, HasSubstr("lower jaw"));
  EXPECT_THAT(written, ::testing::Not(HasSubstr("smith")));
  EXPECT_THAT(parse("4", R"({"file": "a.nii"})"), StatusIs(kInvalid, HasSubstr("labels")));
  EXPECT_THAT(parse("5", R"({"names": {"jaw": [1]}})"),
              StatusIs(kInvalid, HasSubstr("use mandible, skull")));
  EXPECT_THAT(parse("5", R"({"names": {"mandible": [0]}})"),
              StatusIs(kInvalid, HasSubstr("/labels/names")));
}

TEST(RecipeTest, GrayValuesAreOfVersion6) {
  const auto parse = [](int version, const std::string& ct) {
    return ParseRecipe(absl::StrCat(R"({"format": "tissueform-recipe", "version": )", version,
                                    R"(, "segments": [{"name": "chin", "osteotomy": "genioplasty"}],
                                    "ct": )",
                                    ct, "}"),
                       "r");
  };
  ASSERT_OK_AND_ASSIGN(const Recipe given, parse(6, R"({"values": "gray", "tissue_above_gray": 242,
                                                        "bone_above_gray": 605.5})"));
  EXPECT_EQ(given.ct.values, CtValues::kGray);
  EXPECT_EQ(given.ct.tissue_above_gray, 242);
  EXPECT_EQ(given.ct.bone_above_gray, 605.5);
  const std::string written = RecipeToJson(given);
  EXPECT_THAT(written, HasSubstr("\"version\": 6"));
  ASSERT_OK_AND_ASSIGN(const Recipe again, ParseRecipe(written, "again"));
  EXPECT_EQ(RecipeToJson(again), written);
  EXPECT_EQ(again.ct.bone_above_gray, 605.5);

  ASSERT_OK_AND_ASSIGN(const Recipe hu, parse(6, R"({"values": "hu"})"));
  EXPECT_EQ(hu.ct.values, CtValues::kHu);
  EXPECT_THAT(RecipeToJson(hu), HasSubstr("\"values\": \"hu\""));
  ASSERT_OK_AND_ASSIGN(const Recipe automatic, parse(6, R"({"values": "auto"})"));
  EXPECT_EQ(automatic.ct.values, CtValues::kAuto);
  EXPECT_FALSE(automatic.ct.tissue_above_gray.has_value());
  EXPECT_FALSE(automatic.ct.bone_above_gray.has_value());
  EXPECT_THAT(RecipeToJson(automatic), ::testing::Not(HasSubstr("gray")));

  EXPECT_THAT(parse(6, R"({"values": "grey"})"), StatusIs(kInvalid, HasSubstr("/ct/values")));
  EXPECT_THAT(parse(6, R"({"bone_above_gray": 40000})"),
              StatusIs(kInvalid, HasSubstr("/ct/bone_above_gray")));
  EXPECT_THAT(parse(6, R"({"tissue_above_gray": "242"})"),
              StatusIs(kInvalid, HasSubstr("/ct/tissue_above_gray")));
  for (const char* const key : {"values\": \"gray", "tissue_above_gray\": \"1"}) {
    EXPECT_THAT(parse(5, absl::StrCat("{\"", key, "\"}")),
                StatusIs(kInvalid, HasSubstr("version")));
  }
}

TEST(RecipeTest, DissectionIsOfVersion7) {
  const auto parse = [](int version, const std::string& dissected_mm) {
    return ParseRecipe(absl::StrCat(R"({"format": "tissueform-recipe", "version": )", version,
                                    R"(, "segments": [{"name": "chin", "osteotomy": "genioplasty",
                                    "dissected_mm": )",
                                    dissected_mm, "}]}"),
                       "r");
  };
  ASSERT_OK_AND_ASSIGN(const Recipe given, parse(7, "6.5"));
  EXPECT_EQ(given.segments[0].dissected_mm, 6.5);
  const std::string written = RecipeToJson(given);
  EXPECT_THAT(written,
              ::testing::AllOf(HasSubstr("\"version\": 7"), HasSubstr("\"dissected_mm\": 6.5")));
  ASSERT_OK_AND_ASSIGN(const Recipe again, ParseRecipe(written, "again"));
  EXPECT_EQ(again.segments[0].dissected_mm, 6.5);
  for (const char* const wrong : {"-1", "20.5", "\"6\""}) {
    EXPECT_THAT(parse(7, wrong), StatusIs(kInvalid, HasSubstr("/segments/0/dissected_mm")))
        << wrong;
  }
  EXPECT_THAT(parse(6, "6.5"), StatusIs(kInvalid, HasSubstr("version")));
}

TEST(RecipeTest, LipsAreOfVersion4) {
  const auto parse = [](const std::string& version, const std::string& lips) {
    return ParseRecipe(R"({"format": "tissueform-recipe", "version": )" + version +
                           R"(, "segments": [{"name": "chin", "osteotomy": "genioplasty"}], )" +
                           R"("lips": )" + lips + "}",
                       "r");
  };
  ASSERT_OK_AND_ASSIGN(const Recipe given, parse("4", R"({"part": true, "vestibule_mm": 8,
                     "mouth_line_mm": [[-25, 1, 2], [0, 0, 3], [25, 1, 2]]})"));
  EXPECT_TRUE(given.lips.part);
  EXPECT_EQ(given.lips.vestibule_mm, 8);
  ASSERT_EQ(given.lips.mouth_line_mm.size(), 3U);
  EXPECT_EQ(given.lips.mouth_line_mm[2], Eigen::Vector3d(25, 1, 2));
  ASSERT_OK_AND_ASSIGN(const Recipe again, ParseRecipe(RecipeToJson(given), "again"));
  EXPECT_EQ(again.lips.mouth_line_mm, given.lips.mouth_line_mm);
  EXPECT_THAT(RecipeToJson(given), HasSubstr("\"version\": 4"));
  ASSERT_OK_AND_ASSIGN(const Recipe plain, parse("4", "{}"));
  EXPECT_FALSE(plain.lips.part);
  EXPECT_THAT(RecipeToJson(plain), ::testing::Not(HasSubstr("\"lips\"")));
  EXPECT_THAT(parse("3", R"({"part": true})"), StatusIs(kInvalid, HasSubstr("lips")));
  EXPECT_THAT(parse("4", R"({"mouth_line_mm": [[0, 0, 0]]})"),
              StatusIs(kInvalid, HasSubstr("/lips/mouth_line_mm")));
  EXPECT_THAT(parse("4", R"({"mouth_line_mm": [[-25, 1, 2], [0, 0, 3], [25, 1, 2]]})"),
              StatusIs(kInvalid, HasSubstr("unless \"part\" is true")));
  EXPECT_THAT(parse("4", R"({"vestibule_mm": 50})"),
              StatusIs(kInvalid, HasSubstr("/lips/vestibule_mm")));
}

TEST(RecipeTest, KeysOfVersion2ArriveAndAreWrittenAgain) {
  const auto parse = [](const std::string& keys) {
    return ParseRecipe(R"({"format": "tissueform-recipe", "version": 2, "segments": [
                         {"name": "chin", "osteotomy": "genioplasty"}], )" +
                           keys + "}",
                       "r");
  };
  ASSERT_OK_AND_ASSIGN(const Recipe given,
                       parse(R"("ct": {"join_series": "never"}, "metal": 2800)"));
  EXPECT_EQ(given.ct.join_series, JoinSeries::kNever);
  EXPECT_EQ(given.metal.threshold_hu, 2800.0);
  EXPECT_TRUE(given.metal.correct);
  EXPECT_THAT(RecipeToJson(given), ::testing::AllOf(HasSubstr("\"metal\": 2800"),
                                                    HasSubstr("\"join_series\": \"never\""),
                                                    HasSubstr("\"version\": 2")));
  ASSERT_OK_AND_ASSIGN(const Recipe off, parse(R"("metal": "off")"));
  EXPECT_FALSE(off.metal.correct);
  EXPECT_THAT(parse(R"("metal": "on")"), StatusIs(kInvalid, HasSubstr("/metal")));
  EXPECT_THAT(parse(R"("metal": 300)"),
              StatusIs(kInvalid, ::testing::AllOf(HasSubstr("/metal"),
                                                  HasSubstr("a number from 2500 to 32000"))));
  // With this one the bone of a head was 63 pieces of metal, 11 cm3 together, and the plan ready.
  EXPECT_THAT(parse(R"("metal": 1500)"), StatusIs(kInvalid, HasSubstr("/metal")));
}

TEST(RecipeTest, KeysOfVersion3ArriveAndAreWrittenAgain) {
  const auto parse = [](int version, const std::string& frame) {
    return ParseRecipe(absl::StrCat(R"({"format": "tissueform-recipe", "version": )", version,
                                    R"(, "segments": [{"name": "chin", "osteotomy": "genioplasty"}],
                                    "head_frame": )",
                                    frame, "}"),
                       "r");
  };
  const std::string horizontal =
      R"({"horizontal": {"point_mm": [1, 2, 3], "normal": [0, -0.3, 2]}})";
  ASSERT_OK_AND_ASSIGN(const Recipe given, parse(3, horizontal));
  ASSERT_TRUE(given.horizontal.has_value());
  EXPECT_FALSE(given.midsagittal.has_value());
  EXPECT_NEAR(given.horizontal->normal.norm(), 1, 1e-12);
  EXPECT_THAT(RecipeToJson(given),
              ::testing::AllOf(HasSubstr("\"horizontal\""), HasSubstr("\"version\": 3")));
  EXPECT_THAT(parse(2, horizontal), StatusIs(kInvalid, HasSubstr("version")));
  EXPECT_THAT(parse(3, "{}"), StatusIs(kInvalid, HasSubstr("/head_frame")));
  EXPECT_THAT(parse(3, R"({"midsagittal": {"point_mm": [0, 0, 0], "normal": [0, 0, 0]}})"),
              StatusIs(kInvalid, HasSubstr("/head_frame/midsagittal")));
}

TEST(RecipeTest, Version1HasTheDefaultsOfLaterKeysAndRefusesThem) {
  ASSERT_OK_AND_ASSIGN(const Recipe recipe, Parse(""));
  EXPECT_EQ(recipe.ct.join_series, JoinSeries::kAuto);
  EXPECT_TRUE(recipe.metal.correct);
  // The tissues' defaults state how far they are known, which version 1 cannot.
  EXPECT_THAT(RecipeToJson(recipe), HasSubstr("\"version\": 2"));
  constexpr char kTissues[] = R"("tissues": [{"name": "all", "youngs_modulus_pa": 20000}])";
  ASSERT_OK_AND_ASSIGN(const Recipe known, Parse(kTissues));
  EXPECT_THAT(RecipeToJson(known), HasSubstr("\"version\": 1"));
  EXPECT_THAT(Parse(R"("metal": "off")"), StatusIs(kInvalid, HasSubstr("version")));
  EXPECT_THAT(
      Parse(
          R"("tissues": [{"name": "all", "youngs_modulus_pa": 2e4, "youngs_modulus_factor_95": 2}])"),
      StatusIs(kInvalid, HasSubstr("version")));
}

TEST(RecipeTest, TwoSegmentsOfOneNameAreRefused) {
  EXPECT_THAT(ParseRecipe(R"({"format": "tissueform-recipe", "version": 1, "segments": [
                {"name": "a", "osteotomy": "bssro"}, {"name": "a", "osteotomy": "genioplasty"}]})",
                          "r"),
              StatusIs(kInvalid, HasSubstr("named \"a\"")));
}

TEST(RecipeTest, OtherFilesAreRefused) {
  EXPECT_THAT(ParseRecipe("{", "r"), StatusIs(kInvalid, HasSubstr("recipe r")));
  EXPECT_THAT(ReadRecipe("/no/such/recipe.json"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("does not exist")));
}

}  // namespace
}  // namespace tissueform
