// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/markups_file.h"

#include <filesystem>
#include <fstream>
#include <string>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/planning/plan_building/given_landmarks.h"
#include "core/planning/plan_building/recipe.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::IsOk;

std::string MarkupsOf(const std::string& entries) {
  return absl::StrCat(R"({"@schema": "s", "markups": [)", entries, "]}");
}

TEST(MarkupsFileTest, PointsComeInLpsAndMm) {
  const auto markups = ParseMarkups(MarkupsOf(
      R"({"type": "Fiducial", "name": "F", "coordinateSystem": "RAS", "coordinateUnits": "mm",
          "controlPoints": [{"label": "Pog", "position": [1, 2, 3], "positionStatus": "defined"},
                            {"label": "none", "position": [9, 9, 9],
                             "positionStatus": "undefined"}]},
         {"type": "Fiducial", "coordinateSystem": "LPS",
          "coordinateUnits": ["um", "UCUM", "micrometer"],
          "controlPoints": [{"label": "a", "position": [1000, 2000, 3000]}]})"));
  ASSERT_THAT(markups.status(), IsOk());
  ASSERT_EQ(markups->size(), 2);
  ASSERT_EQ(markups->at(0).points.size(), 1);
  EXPECT_EQ(markups->at(0).points[0].label, "Pog");
  EXPECT_EQ(markups->at(0).points[0].position_mm, Eigen::Vector3d(-1, -2, 3));
  EXPECT_LT((markups->at(1).points[0].position_mm - Eigen::Vector3d(1, 2, 3)).norm(), 1e-12);
}

TEST(MarkupsFileTest, PlanesHaveANormalOrThreePoints) {
  const auto markups = ParseMarkups(MarkupsOf(
      R"({"type": "Plane", "coordinateSystem": "RAS", "center": [1, 2, 3], "normal": [0, 3, 4],
          "controlPoints": [{"position": [0, 0, 0]}]},
         {"type": "Plane", "normal": [0, 0, 2], "controlPoints": [{"position": [7, 8, 9]}]},
         {"type": "Fiducial", "controlPoints": [{"position": [0, 0, 5]}, {"position": [2, 0, 5]},
                                                {"position": [0, 2, 5]}, {"position": [2, 2, 5]}]},
         {"type": "Curve", "controlPoints": [{"position": [0, 0, 0]}, {"position": [1, 1, 1]},
                                             {"position": [2, 2, 2]}]})"));
  ASSERT_THAT(markups.status(), IsOk());
  EXPECT_EQ(markups->at(0).plane->point_mm, Eigen::Vector3d(-1, -2, 3));
  EXPECT_LT((markups->at(0).plane->normal - Eigen::Vector3d(0, -0.6, 0.8)).norm(), 1e-12);
  EXPECT_EQ(markups->at(1).plane->point_mm, Eigen::Vector3d(7, 8, 9));
  EXPECT_LT((markups->at(2).plane->normal - Eigen::Vector3d(0, 0, 1)).norm(), 1e-12);
  EXPECT_DOUBLE_EQ(markups->at(2).plane->point_mm.z(), 5);
  EXPECT_FALSE(markups->at(3).plane.has_value());
}

TEST(MarkupsFileTest, RefusesInvalidMarkups) {
  const auto said = [](const std::string& text) {
    const auto markups = ParseMarkups(text);
    EXPECT_FALSE(markups.ok()) << text;
    return std::string(markups.status().message());
  };
  EXPECT_THAT(said("{}"), HasSubstr("not a markups file"));
  EXPECT_THAT(said("[1]"), HasSubstr("not a markups file"));
  EXPECT_THAT(said(MarkupsOf("")), HasSubstr("empty"));
  EXPECT_THAT(said(MarkupsOf("3")), HasSubstr("not an object"));
  EXPECT_THAT(said(MarkupsOf(R"({"coordinateSystem": "IJK"})")), HasSubstr("neither \"LPS\""));
  EXPECT_THAT(said(MarkupsOf(R"({"coordinateUnits": "inch"})")), HasSubstr("coordinateUnits"));
  EXPECT_THAT(said(MarkupsOf(R"({"controlPoints": [{"position": [1, 2]}]})")),
              HasSubstr("three numbers"));
  EXPECT_THAT(said(MarkupsOf(R"({"controlPoints": [{"position": [1, 2, 1e9]}]})")),
              HasSubstr("within 1e6"));
  EXPECT_THAT(said(MarkupsOf(R"({"normal": [0, 0, 0], "center": [1, 2, 3]})")),
              HasSubstr("no length"));
  EXPECT_THAT(said(MarkupsOf(R"({"normal": [0, 0, 1]})")), HasSubstr("no center"));
}

TEST(GivenLandmarksTest, LabelsAreNamesAndAbbreviations) {
  EXPECT_EQ(LandmarkNameOf("Pogonion"), "pogonion");
  EXPECT_EQ(LandmarkNameOf(" Pog "), "pogonion");
  EXPECT_EQ(LandmarkNameOf("Go L"), "gonion_left");
  EXPECT_EQ(LandmarkNameOf("orbitale-right"), "orbitale_right");
  EXPECT_EQ(LandmarkNameOf("Pog'"), "soft_pogonion");
  EXPECT_EQ(LandmarkNameOf("F-1"), "");
}

Landmarks SomeLandmarks() {
  Landmarks landmarks;
  landmarks.midsagittal = {{0, 0, 0}, {1, 0, 0}};
  landmarks.lower_incisor = {0, -70, -50};
  landmarks.upper_incisor = {0, -72, -48};
  landmarks.lower_molar = {{20, -40, -50}, {-20, -40, -50}};
  landmarks.upper_molar = {{20, -40, -48}, {-20, -40, -48}};
  landmarks.pogonion = {0, -68, -90};
  landmarks.SetTeethPlanes();
  return landmarks;
}

TEST(GivenLandmarksTest, TakeThePlaceOfFoundOnes) {
  Landmarks landmarks = SomeLandmarks();
  std::optional<FrankfortLandmarks> frankfort;
  std::vector<std::string> notes;
  ASSERT_THAT(PlaceLandmarks({{"pogonion", {1, -69, -91}},
                              {"lower_incisor", {0, -70, -44}},
                              {"porion_left", {60, 20, 0}},
                              {"porion_right", {-60, 20, 0}},
                              {"orbitale_left", {30, -50, 0}},
                              {"orbitale_right", {-30, -50, 0}}},
                             &landmarks, &frankfort, &notes),
              IsOk());
  EXPECT_EQ(landmarks.pogonion, Eigen::Vector3d(1, -69, -91));
  EXPECT_NE(landmarks.lower_teeth.normal, SomeLandmarks().lower_teeth.normal);
  ASSERT_TRUE(frankfort.has_value());
  EXPECT_EQ(frankfort->orbitale.right, Eigen::Vector3d(-30, -50, 0));
  ASSERT_EQ(notes.size(), 1);
  EXPECT_THAT(notes[0], HasSubstr("pogonion"));
}

TEST(GivenLandmarksTest, RefusesImpossibleLandmarks) {
  const auto said = [](const GivenLandmarks& given) {
    Landmarks landmarks = SomeLandmarks();
    std::optional<FrankfortLandmarks> frankfort;
    std::vector<std::string> notes;
    return std::string(PlaceLandmarks(given, &landmarks, &frankfort, &notes).message());
  };
  EXPECT_THAT(said({{"pogonion", {0, 68, -90}}}), HasSubstr("136 mm from where the CT shows it"));
  EXPECT_THAT(said({{"chin", {0, 0, 0}}}), HasSubstr("\"chin\" is not the name of a landmark"));
  EXPECT_THAT(said({{"porion_left", {0, 0, 0}}}), HasSubstr("all four"));
}

class RecipeMarkupsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = ::testing::TempDir() + "/recipe_markups";
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
    Write("plane.mrk.json", MarkupsOf(R"({"type": "Plane", "name": "p", "coordinateSystem": "RAS",
                        "center": [1, 2, 3], "normal": [0, 0, -1]})"));
    Write("two.mrk.json",
          MarkupsOf(R"({"type": "Plane", "name": "a", "center": [0, 0, 1], "normal": [0, 0, 1]},
                       {"type": "Plane", "name": "b", "center": [0, 0, 2], "normal": [0, 0, 1]})"));
    Write("line.mrk.json",
          MarkupsOf(R"({"type": "Curve", "controlPoints": [{"position": [25, 0, 0]},
                        {"position": [0, 1, 0]}, {"position": [-25, 0, 0]}]})"));
    Write("points.mrk.json",
          MarkupsOf(R"({"type": "Fiducial", "coordinateSystem": "RAS", "controlPoints": [
                        {"label": "Pog", "position": [1, 2, 3]},
                        {"label": "F-2", "position": [4, 5, 6]}]})"));
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  void Write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ + "/" + name) << text;
  }
  absl::StatusOr<Recipe> Read(const std::string& keys, const std::string& planes = "") const {
    Write("recipe.json",
          absl::StrCat(R"({"format": "tissueform-recipe", "version": 6, "segments": [{"name": "m",
                           "osteotomy": "bssro")",
                       planes, "}]", keys.empty() ? "" : ", ", keys, "}"));
    return ReadRecipe(folder_ + "/recipe.json");
  }
  std::string Refusal(const std::string& keys) const {
    const absl::StatusOr<Recipe> recipe = Read(keys);
    EXPECT_FALSE(recipe.ok());
    return std::string(recipe.status().message());
  }

  std::string folder_;
};

TEST_F(RecipeMarkupsTest, PlanesFaceTheSideThatTheKeyMeans) {
  const auto recipe = Read(
      R"("occlusal_plane": {"file": "plane.mrk.json"},
         "region_of_interest": {"above": {"file": "plane.mrk.json"}},
         "head_frame": {"horizontal": {"file": "two.mrk.json", "name": "b"}})",
      R"(, "planes": [{"file": "plane.mrk.json"}, {"file": "plane.mrk.json", "flip": true}])");
  ASSERT_THAT(recipe.status(), IsOk());
  EXPECT_EQ(recipe->occlusal_plane->point_mm, Eigen::Vector3d(-1, -2, 3));
  EXPECT_EQ(recipe->occlusal_plane->normal, Eigen::Vector3d(0, 0, 1));
  EXPECT_EQ(recipe->above->normal, Eigen::Vector3d(0, 0, -1));
  EXPECT_EQ(recipe->horizontal->point_mm.z(), 2);
  EXPECT_EQ(recipe->segments[0].planes[0].normal, Eigen::Vector3d(0, 0, -1));
  EXPECT_EQ(recipe->segments[0].planes[1].normal, Eigen::Vector3d(0, 0, 1));
}

TEST_F(RecipeMarkupsTest, MouthLineAndLandmarksComeFromFiles) {
  const auto recipe = Read(R"("lips": {"part": true, "mouth_line_file": "line.mrk.json"},
                              "landmarks": {"file": "points.mrk.json",
                                            "points_mm": {"menton": [7, 8, 9]}})");
  ASSERT_THAT(recipe.status(), IsOk());
  ASSERT_EQ(recipe->lips.mouth_line_mm.size(), 3);
  EXPECT_EQ(recipe->lips.mouth_line_mm.front().x(), -25);  // the patient's right comes first
  ASSERT_EQ(recipe->landmarks.size(), 2);
  EXPECT_EQ(recipe->landmarks.at("pogonion"), Eigen::Vector3d(-1, -2, 3));
  EXPECT_EQ(recipe->landmarks.at("menton"), Eigen::Vector3d(7, 8, 9));
  // What the report shows is a recipe without files.
  EXPECT_THAT(ParseRecipe(RecipeToJson(*recipe), "report").status(), IsOk());
}

TEST_F(RecipeMarkupsTest, FilesThatDoNotFitAreRefused) {
  EXPECT_THAT(Refusal(R"("occlusal_plane": {"file": "none.mrk.json"})"),
              HasSubstr("at /occlusal_plane: "));
  EXPECT_THAT(Refusal(R"("occlusal_plane": {"file": "two.mrk.json"})"), HasSubstr("has 2 planes"));
  EXPECT_THAT(Refusal(R"("occlusal_plane": {"file": "two.mrk.json", "name": "c"})"),
              HasSubstr("no plane of that name"));
  EXPECT_THAT(Refusal(R"("occlusal_plane": {"file": "points.mrk.json"})"), HasSubstr("no plane"));
  EXPECT_THAT(Refusal(R"("occlusal_plane": {"file": "plane.mrk.json", "normal": [0, 0, 1]})"),
              HasSubstr("give one"));
  EXPECT_THAT(Refusal(R"("occlusal_plane": {"normal": [0, 0, 1]})"), HasSubstr("needs"));
  EXPECT_THAT(Refusal(R"("landmarks": {"file": "line.mrk.json"})"), HasSubstr("label the points"));
  EXPECT_THAT(Refusal(R"("lips": {"part": true, "mouth_line_file": "two.mrk.json"})"),
              HasSubstr("must hold one curve"));
  EXPECT_THAT(std::string(ParseRecipe(R"({"format": "tissueform-recipe", "version": 6,
      "segments": [{"name": "m", "osteotomy": "bssro"}],
      "occlusal_plane": {"file": "plane.mrk.json"}})",
                                      "text")
                              .status()
                              .message()),
              HasSubstr("has no folder"));
}

}  // namespace
}  // namespace tissueform
