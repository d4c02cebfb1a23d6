// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/fit_targets.h"

#include <filesystem>
#include <fstream>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include "nlohmann/json.hpp"

#include "core/mesh/skin_region.h"
#include "core/planning/fitted_plan.h"
#include "core/planning/plan_io.h"
#include "tests/core/planning/plan_text.h"
#include "tests/testing/handle_problem.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;
using Json = nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::kInvalid;
using testing::StatusIs;

// A bar whose sides are a chin and a lower lip.
PlanProblem BarProblem(CoordinateSystem axes) {
  const TetMesh bar = testing::Bar({4, 4, 8}, 2.0);
  std::vector<uint8_t> region(static_cast<size_t>(bar.num_vertices()), 0);
  for (Eigen::Index v = 0; v < bar.num_vertices(); ++v) {
    if (bar.positions()(v, 1) == 0) {
      region[static_cast<size_t>(v)] = static_cast<uint8_t>(
          bar.positions()(v, 2) < 8 ? SkinRegion::kChin : SkinRegion::kLowerLip);
    }
  }
  return {.mesh = std::make_shared<const TetMesh>(bar),
          .point_data = {{"skin_region", 1, region}},
          .cell_data = {},
          .written_in = axes,
          .stiffness = {},
          .constraints = testing::StackedHandles(bar, 1),
          .poses = std::vector<HandlePose>(1),
          .deformer = {},
          .uncertainty = {}};
}

Json Targets() {
  return Json::parse(R"({
    "format": "tissueform-targets", "version": 1, "unit": "mm", "coordinate_system": "LPS",
    "targets": [{"name": "side", "at": {"point_mm": [0, 4, 8]}, "move_mm": [1, 2, 3]}],
    "free": [{"handle": "handle 0", "translation_mm": [null, [-2, 3], null],
              "rotation_vector_deg": [[-45, 90], null, null], "pivot_mm": [1, 2, 3]}]})");
}

absl::StatusOr<FitRequest> Parse(const Json& json, CoordinateSystem axes = CoordinateSystem::kLps) {
  return ParseFitTargets(json.dump(), "t.json", BarProblem(axes));
}

Json With(const std::string& pointer, const Json& value) {
  Json json = Targets();
  json[Json::json_pointer(pointer)] = value;
  return json;
}

TEST(FitTargetsTest, NumbersBecomeRadiansAndDefaultsAreThoseOfTheSchema) {
  ASSERT_OK_AND_ASSIGN(const FitRequest request, Parse(Targets()));
  const FitFreedom& moving = request.moving.at(0);
  EXPECT_DOUBLE_EQ((*moving.rotation[0])[0], -std::numbers::pi / 4);
  EXPECT_DOUBLE_EQ((*moving.rotation[0])[1], std::numbers::pi / 2);
  EXPECT_EQ(*moving.translation[1], (std::array{-2.0, 3.0}));
  EXPECT_FALSE(moving.translation[0].has_value());
  EXPECT_EQ(moving.pivot_mm, Vector3d(1, 2, 3));
  EXPECT_EQ(request.targets.at(0).displacement_mm, Vector3d(1, 2, 3));
  const Json schema = Json::parse(FitTargetsSchemaText());
  EXPECT_EQ(request.less_movement, schema["properties"]["less_movement"]["default"]);
  EXPECT_EQ(request.tolerance_mm, schema["properties"]["tolerance_mm"]["default"]);
  EXPECT_EQ(kMaxFitTargets, schema["properties"]["targets"]["maxItems"]);
}

TEST(FitTargetsTest, PlacesAreTheirVerticesOrTheForemostOne) {
  Json json = With("/targets/0", {{"at", {{"place", "chin"}}}, {"along", "forward"}, {"by_mm", 5}});
  ASSERT_OK_AND_ASSIGN(const FitRequest mean, Parse(json));
  EXPECT_EQ(mean.targets.at(0).name, "chin");
  EXPECT_EQ(mean.targets.at(0).vertices.size(), 20);
  EXPECT_EQ(mean.targets.at(0).direction, Vector3d(0, -1, 0));
  json["targets"][0]["at"]["foremost"] = true;
  ASSERT_OK_AND_ASSIGN(const FitRequest foremost, Parse(json));
  EXPECT_EQ(foremost.targets.at(0).vertices.size(), 1);
  // Forward is forward in all axes.
  json["coordinate_system"] = "RAS";
  ASSERT_OK_AND_ASSIGN(const FitRequest ras, Parse(json, CoordinateSystem::kRas));
  EXPECT_EQ(ras.targets.at(0).direction, Vector3d(0, 1, 0));
}

TEST(FitTargetsTest, SelectorsNameVerticesOfTheSurfaceInThePlansAxes) {
  Json json = With("/targets/0/at",
                   {{"box_mm", {{"min", {3, 3, 7}}, {"max", {9, 5, 9}}}}});  // one inside, two not
  json["targets"][0].erase("name");
  ASSERT_OK_AND_ASSIGN(const FitRequest request, Parse(json));
  EXPECT_EQ(request.targets.at(0).name, "target 1");
  const TetMesh bar = testing::Bar({4, 4, 8}, 2.0);
  ASSERT_EQ(request.targets.at(0).vertices.size(), 1);
  EXPECT_EQ(bar.positions().row(request.targets.at(0).vertices[0]), Eigen::RowVector3d(8, 4, 8));
  json["coordinate_system"] = "RAS";
  json["targets"][0]["at"] = {{"box_mm", {{"min", {-9, -5, 7}}, {"max", {-7, -3, 9}}}}};
  ASSERT_OK_AND_ASSIGN(const FitRequest ras, Parse(json, CoordinateSystem::kRas));
  EXPECT_EQ(ras.targets.at(0).vertices, request.targets.at(0).vertices);
}

TEST(FitTargetsTest, ExampleOfTheDocsIsRead) {
  Json example;
  std::ifstream(testing::SourcePath("docs/examples/fit/chin_forward_5mm.json")) >> example;
  ASSERT_OK_AND_ASSIGN(const FitRequest request, Parse(example));
  EXPECT_TRUE(request.symmetric);
  EXPECT_EQ(request.moving.size(), 2);
}

TEST(FitTargetsTest, MistakesAreNamedInOneLine) {
  const auto refused = [](const Json& json, const std::string& why) {
    EXPECT_THAT(Parse(json),
                StatusIs(kInvalid, AllOf(HasSubstr("targets t.json: "), HasSubstr(why))));
  };
  refused(With("/colour", 1), "unknown key \"colour\"");
  refused(With("/version", 7), "version");
  refused(With("/targets/0/at/point_mm", {1, 2}), "/targets/0/at");
  refused(With("/targets/0/weight", 0), "/targets/0/weight");
  refused(With("/free/0/translation_mm/1", {3, -2}),
          "bounds of its translation along y are reversed");
  refused(With("/free/0/translation_mm", {{1, 2}}), "/free/0/translation_mm");
  refused(With("/coordinate_system", "RAS"), "its coordinate_system is RAS but the plan's is LPS");
  refused(With("/targets/0/at/place", "chin"), "/targets/0/at");
  refused(With("/targets/0/at/foremost", true), "/targets/0/at");
  refused(With("/targets/0/by_mm", 3), "along and by_mm belong together");
  refused(With("/targets/0/to_mm", {1, 2, 3}), "it must have one goal");
  refused(With("/targets/0/at", {{"box_mm", {{"min", {3, 3, 7}}, {"max", {5, 5, 9}}}}}),
          "\"at\" selects no vertex of the surface");
  refused(With("/targets/0/at", {{"vertices", {9999}}}), "\"at\"");
  Json place = Targets();
  place["targets"][0]["at"] = {{"place", "ear"}};
  refused(place, "target \"side\": the mesh has no place \"ear\"; it has lower_lip, chin, face");
  PlanProblem bare = BarProblem(CoordinateSystem::kLps);
  bare.point_data.clear();
  EXPECT_THAT(ParseFitTargets(place.dump(), "t.json", bare),
              StatusIs(kInvalid, HasSubstr("no point array skin_region")));
}

TEST(FitTargetsTest, RefusesInvalidJsonAndInvalidNumbers) {
  const PlanProblem problem = BarProblem(CoordinateSystem::kLps);
  std::string text = Targets().dump();
  EXPECT_THAT(ParseFitTargets(text + "x", "t.json", problem),
              StatusIs(kInvalid, HasSubstr("not valid JSON")));
  for (const char* number : {"NaN", "1e999"}) {
    std::string bad = text;
    bad.replace(bad.find("-45"), 3, number);
    EXPECT_THAT(ParseFitTargets(bad, "t.json", problem), StatusIs(kInvalid)) << number;
  }
}

TEST(FitTargetsTest, FilesThatAreMissingOrTooLargeAreRefused) {
  const PlanProblem problem = BarProblem(CoordinateSystem::kLps);
  EXPECT_THAT(ReadFitTargets("/nowhere/t.json", problem),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("targets file /nowhere/t.json")));
  const std::string path = ::testing::TempDir() + "/large_targets.json";
  std::ofstream(path) << std::string(kMaxTargetsBytes + 1, ' ');
  EXPECT_THAT(ReadFitTargets(path, problem), StatusIs(absl::StatusCode::kResourceExhausted));
  std::filesystem::remove(path);
}

TEST(FitTargetsTest, PlanWithPosesKeepsAllElse) {
  const Json plan = Json::parse(testing::GoodPlan().dump());
  HandlePose pose;
  pose.translation_mm = {1, 2, 3};
  std::vector<HandlePose> poses(plan["handles"].size(), pose);
  std::vector<bool> changed(poses.size(), false);
  changed[0] = true;
  ASSERT_OK_AND_ASSIGN(const std::string text,
                       PlanWithPoses(plan.dump(), "other/mesh.vtu", poses, changed));
  ASSERT_OK_AND_ASSIGN(const Plan read, ParsePlan(text, "", "fitted.json"));
  EXPECT_EQ(read.handles[0].pose.translation_mm, Vector3d(1, 2, 3));
  Json written = Json::parse(text);
  EXPECT_EQ(written["mesh"], "other/mesh.vtu");
  written["mesh"] = plan["mesh"];
  written["handles"][0]["pose"] = plan["handles"][0]["pose"];
  EXPECT_EQ(written, plan);
}

TEST(FitTargetsTest, PlanWithPosesDropsMeasurementsOfTheOldPoses) {
  const Json plan = testing::GoodPlan();
  Json exported = plan;
  exported["version"] = 3;
  exported["landmarks"] = Json::array({{{"name", "pogonion"}, {"totalMm", 8}}});
  exported["measures"] = Json::array();
  exported["answer"] = nullptr;
  const std::vector<HandlePose> poses(plan["handles"].size());
  ASSERT_OK_AND_ASSIGN(const std::string text,
                       PlanWithPoses(exported.dump(), "mesh.vtu", poses, {false}));
  EXPECT_EQ(Json::parse(text), plan);
}

}  // namespace
}  // namespace tissueform
