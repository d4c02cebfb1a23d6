// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <functional>
#include <numbers>
#include <variant>

#include "core/planning/model_names.h"
#include "core/planning/plan_io.h"
#include "core/planning/plan_schema.h"
#include "tests/core/planning/plan_text.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::Pair;
using tissueform::testing::GoodPlan;
using tissueform::testing::IsOk;
using tissueform::testing::Parse;
using tissueform::testing::PlanWith;
using tissueform::testing::TestDataPath;

TEST(PlanParserTest, EveryValueArrivesInItsUnit) {
  ASSERT_OK_AND_ASSIGN(const Plan plan, Parse(GoodPlan(), "/some/folder"));
  EXPECT_EQ(plan.coordinate_system, CoordinateSystem::kLps);
  EXPECT_EQ(plan.mesh_path, "/some/folder/mesh.vtu");
  EXPECT_EQ(std::get<UniformStiffness>(plan.stiffness).pa, 15000);
  EXPECT_EQ(plan.poisson_ratio, 0.45);
  ASSERT_EQ(plan.handles.size(), 1U);
  const HandlePose& pose = plan.handles[0].pose;
  EXPECT_TRUE(pose.rotation_vector.isApprox(Eigen::Vector3d(0, 0, std::numbers::pi / 2)));
  EXPECT_EQ(pose.pivot_mm, Eigen::Vector3d(1, 2, 4));
  EXPECT_EQ(pose.translation_mm, Eigen::Vector3d(0.5, -1, 2));
  EXPECT_EQ(pose.scale, 1.25);
  EXPECT_EQ(plan.gradient_field.rotation, RotationMode::kPropagated);
}

TEST(PlanParserTest, PoseLeftOutIsTheIdentity) {
  nlohmann::json json = GoodPlan();
  json["handles"][0].erase("pose");
  ASSERT_OK_AND_ASSIGN(const Plan plan, Parse(json));
  EXPECT_TRUE(plan.handles[0].pose.rotation_vector.isZero(0));
  EXPECT_EQ(plan.handles[0].pose.scale, 1.0);
}

TEST(PlanParserTest, RotationBeyondFullTurnsIsKept) {
  ASSERT_OK_AND_ASSIGN(const Plan plan,
                       Parse(PlanWith("/handles/0/pose/rotation_vector_deg", {0, 720, 0})));
  EXPECT_DOUBLE_EQ(plan.handles[0].pose.rotation_vector[1], 4 * std::numbers::pi);
}

TEST(PlanParserTest, EverySelectorIsRead) {
  ASSERT_OK_AND_ASSIGN(const Plan plan,
                       Parse(PlanWith("/fixed", nlohmann::json::parse(R"({"union": [
                         {"vertices": [0, 5]}, {"point_data": "anatomy", "equals": 2},
                         {"union": [{"box_mm": {"min": [0, 0, 0], "max": [1, 2, 3]}}]}]})"))));
  const auto& parts = std::get<SelectUnion>(plan.fixed.choice).of;
  ASSERT_EQ(parts.size(), 3U);
  EXPECT_THAT(std::get<SelectVertices>(parts[0].choice).vertices, ElementsAre(0, 5));
  EXPECT_EQ(std::get<SelectByPointData>(parts[1].choice).equals, 2);
  const auto& box = std::get<SelectBox>(std::get<SelectUnion>(parts[2].choice).of[0].choice);
  EXPECT_EQ(box.max_mm, Eigen::Vector3d(1, 2, 3));
}

TEST(PlanParserTest, EveryStiffnessIsRead) {
  ASSERT_OK_AND_ASSIGN(const Plan by_array, Parse(PlanWith("/stiffness", {{"cell_data", "pa"}})));
  EXPECT_EQ(std::get<StiffnessFromCellData>(by_array.stiffness).name, "pa");
  ASSERT_OK_AND_ASSIGN(
      const Plan by_label,
      Parse(PlanWith(
          "/stiffness",
          nlohmann::json::parse(R"({"by_cell_data": "part", "values": {"-1": 5, "2": 7}})"))));
  EXPECT_THAT(std::get<StiffnessByCellData>(by_label.stiffness).pa_of_value,
              ElementsAre(Pair(-1, 5.0), Pair(2, 7.0)));
}

TEST(PlanParserTest, SettingsOfTheGradientFieldAreRead) {
  ASSERT_OK_AND_ASSIGN(const Plan plan,
                       Parse(PlanWith("/gradient_field", {{"rotation", "estimated"},
                                                          {"guidance", "uniform"},
                                                          {"blend", "linear"},
                                                          {"max_iterations", 5},
                                                          {"tolerance_mm", 0.1}})));
  EXPECT_EQ(plan.gradient_field.rotation, RotationMode::kEstimated);
  EXPECT_EQ(plan.gradient_field.guidance, Guidance::kUniform);
  EXPECT_EQ(plan.gradient_field.blend, BlendMap::kLinear);
  EXPECT_EQ(plan.gradient_field.max_iterations, 5);
  EXPECT_EQ(plan.gradient_field.tolerance_mm, 0.1);
}

TEST(PlanParserTest, BundledPlansFollowTheSchema) {
  EXPECT_THAT(ReadPlan(TestDataPath("plans/tongue/plan.json")), IsOk());
  EXPECT_THAT(ReadPlan(TestDataPath("plans/bar/plan.json")), IsOk());
}

TEST(PlanSchemaTest, EveryObjectOfItForbidsUnknownKeysAndEveryPropertyIsDescribed) {
  const std::function<void(const nlohmann::json&)> check = [&](const nlohmann::json& node) {
    if (node.is_object() && node.value("type", "") == "object") {
      EXPECT_EQ(node.value("additionalProperties", true), false) << node;
    }
    if (node.is_object() && node.contains("properties")) {
      for (const auto& property : node["properties"]) {
        EXPECT_TRUE(property.contains("description") || property.contains("$ref")) << property;
      }
    }
    if (node.is_structured()) {
      for (const auto& child : node) check(child);
    }
  };
  check(PlanSchema());
}

TEST(PlanSchemaTest, ModelsOfTheSchemaAreThoseThatTheProgramNames) {
  EXPECT_EQ(PlanSchema()["properties"]["model"]["enum"], nlohmann::json(KnownModelNames()));
}

}  // namespace
}  // namespace tissueform
