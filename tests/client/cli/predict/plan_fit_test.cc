// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <fstream>
#include <string>
#include <vector>

#include "nlohmann/json.hpp"

#include "core/mesh/io/tet_mesh_io.h"
#include "core/planning/planned_contact.h"
#include "core/planning/skin_places.h"
#include "tests/testing/meshes.h"
#include "tests/testing/parted_block.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using Eigen::Vector3d;
using Json = nlohmann::json;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

Json ReadJson(const std::string& path) {
  std::ifstream stream(path);
  return Json::parse(stream);
}

Vector3d ToVector(const Json& json) {
  return {json[0].get<double>(), json[1].get<double>(), json[2].get<double>()};
}

// The bundled bar of 20 x 20 x 60 mm, its top free to move.
class PlanFitTest : public CliTest {
 protected:
  void SetUp() override {
    CliTest::SetUp();
    WriteBar();
    Write("plan.json", ReadJson(TestDataPath("plans/bar/plan.json")).dump());
    targets_ = Json::parse(R"({
      "format": "tissueform-targets", "version": 1, "unit": "mm", "coordinate_system": "LPS",
      "free": [{"handle": "top", "translation_mm": [[-6, 6], [-6, 6], [-6, 6]],
                "rotation_vector_deg": [[-10, 10], [-10, 10], [-10, 10]]}],
      "targets": [{"name": "side", "at": {"point_mm": [0, 10, 40]}, "along": [1, 0, 0],
                   "by_mm": 2}]})");
  }

  ProcessResult Fit(std::vector<std::string> more = {}) {
    Write("targets.json", targets_.dump());
    std::vector<std::string> words = {"plan", "fit", "plan.json", "--targets", "targets.json"};
    words.insert(words.end(), more.begin(), more.end());
    return Run(words);
  }
  ProcessResult FitWith(const std::string& pointer, const Json& value) {
    const Json sound = targets_;
    targets_[Json::json_pointer(pointer)] = value;
    ProcessResult result = Fit({"--out", "fitted.json"});
    targets_ = sound;
    return result;
  }

  // How far what `deform` makes of a plan moves a vertex.
  Vector3d Displacement(const std::string& plan, Eigen::Index vertex) {
    EXPECT_THAT(Run({"deform", plan, "--out", "after.vtu"}), Succeeds());
    const absl::StatusOr<TetMeshFile> before = ReadTetMesh(Path("bar.vtu"));
    const absl::StatusOr<TetMeshFile> after = ReadTetMesh(Path("after.vtu"));
    return after->mesh.positions().row(vertex) - before->mesh.positions().row(vertex);
  }

  Json targets_;
};

TEST_F(PlanFitTest, DeformingTheFittedPlanReachesTheTarget) {
  constexpr Eigen::Index kVertex = 200;  // 8 layers up: at its layer's rim
  const TetMeshFile bar = *ReadTetMesh(Path("bar.vtu"));
  const Vector3d rest = bar.mesh.positions().row(kVertex);
  targets_["targets"] = {{{"name", "rim"},
                          {"at", {{"point_mm", {rest.x(), rest.y(), rest.z()}}}},
                          {"move_mm", {1.5, -1, 0.5}}}};
  const ProcessResult result = Fit({"--out", "fitted.json"});
  EXPECT_THAT(result, Succeeds());
  EXPECT_THAT(result.out, AllOf(HasSubstr("top translation_x_mm"), HasSubstr("wrote fitted.json"),
                                HasSubstr("more free numbers than equations"),
                                HasSubstr("not a medical device")));
  EXPECT_LT((Displacement("fitted.json", kVertex) - Vector3d(1.5, -1, 0.5)).norm(), 0.01);
}

TEST_F(PlanFitTest, JsonReportsAllResultsWithUnitsAndNotice) {
  const ProcessResult result = Fit({"--json"});
  EXPECT_THAT(result, Succeeds());
  const Json json = Json::parse(result.out);
  EXPECT_EQ(json["format"], "tissueform-fit");
  EXPECT_THAT(json["notice"].get<std::string>(), HasSubstr("not a medical device"));
  EXPECT_TRUE(json["reached"]);
  EXPECT_TRUE(json["verified"]);
  EXPECT_EQ(json["equations"], 1);
  EXPECT_EQ(json["parameters"].size(), 6);
  EXPECT_EQ(json["directions"].size(), 6);
  EXPECT_EQ(json["parameters"][0]["parameter"], "top rotation_x_deg");
  EXPECT_NEAR(json["targets"][0]["reached_mm"][0].get<double>(), 2, 0.01);
}

TEST_F(PlanFitTest, TargetsThatAreNotReachedEndWithOneAndThePlanIsWritten) {
  targets_["targets"][0]["by_mm"] = 30;
  EXPECT_THAT(Fit({"--out", "fitted.json"}),
              FailsWith(1, AllOf(HasSubstr("1 of 1 targets cannot be reached: largest miss: "
                                           "\"side\" by "),
                                 HasSubstr("active bounds: top"))));
  EXPECT_THAT(Files(), ElementsAre("bar.vtu", "fitted.json", "plan.json", "targets.json"));
  const ProcessResult accepted = Fit({"--accept-misses"});
  EXPECT_THAT(accepted, Succeeds());
  EXPECT_THAT(accepted.out, AllOf(HasSubstr("NOT REACHED"), HasSubstr("held by its upper bound")));
}

TEST_F(PlanFitTest, ContradictoryTargetsAreBothReported) {
  Json other = targets_["targets"][0];
  other["name"] = "same side";
  other["by_mm"] = -2;
  targets_["targets"].push_back(other);
  EXPECT_THAT(Fit(),
              FailsWith(1, AllOf(HasSubstr("\"side\" by 2.0"), HasSubstr("\"same side\" by 2.0"),
                                 HasSubstr("which contradict each other"))));
}

TEST_F(PlanFitTest, DoesNotReplaceFilesWithoutOverwrite) {
  Write("fitted.json", "mine");
  EXPECT_THAT(Fit({"--out", "fitted.json"}), FailsWith(1, HasSubstr("--out fitted.json exists")));
  EXPECT_EQ(Read("fitted.json"), "mine");
  EXPECT_THAT(Fit({"--out", "fitted.json", "--overwrite"}), Succeeds());
  EXPECT_THAT(Read("fitted.json"), HasSubstr("tissueform-plan"));
  EXPECT_THAT(Fit({"--out", "plan.json", "--overwrite"}),
              FailsWith(1, HasSubstr("would overwrite an input file")));
}

TEST_F(PlanFitTest, BadTargetsAreOneLineAndNothingIsWritten) {
  EXPECT_THAT(FitWith("/targets/0/at/point_mm", {-9, 10, 40}),
              FailsWith(1, AllOf(HasSubstr("targets.json: target \"side\""),
                                 HasSubstr(" mm off the skin"))));
  EXPECT_THAT(FitWith("/free/0/handle", "jaw"), FailsWith(1, HasSubstr("it has top")));
  EXPECT_THAT(FitWith("/targets/0/weight", 0), FailsWith(1, HasSubstr("/targets/0/weight")));
  EXPECT_THAT(FitWith("/free/0/translation_mm/0", {2, 1}), FailsWith(1, HasSubstr("are reversed")));
  EXPECT_THAT(FitWith("/free/0/rotation_vector_deg/0", {-1700, 1700}),
              FailsWith(1, HasSubstr("rotation about x exceed 90 degrees")));
  EXPECT_THAT(FitWith("/targets/0/by_mm", "far"), FailsWith(1, HasSubstr("/targets/0/by_mm")));
  EXPECT_THAT(Run({"plan", "fit", "plan.json", "--targets", "none.json"}),
              FailsWith(1, HasSubstr("targets file none.json does not exist")));
  EXPECT_THAT(Run({"plan", "fit", "plan.json"}), FailsWith(2, HasSubstr("--targets")));
  EXPECT_THAT(Fit({"--model", "arap"}), FailsWith(1, HasSubstr("arap has no prepared answers")));
  EXPECT_THAT(Files(), ElementsAre("bar.vtu", "plan.json", "targets.json"));
}

// A lower jaw turned and moved; the fit only receives `deform`'s answer at places of the face.
// The lower edge follows the upper one only where lips are sealed.
TEST_F(PlanFitTest, SealedLipsAreFittedWithTheirSeal) {
  const PartedBlock block;
  ASSERT_THAT(
      WriteTetMesh(Path("bar.vtu"), {.mesh = block.mesh, .point_data = {}, .cell_data = {}}),
      IsOk());
  Json plan = ReadJson(TestDataPath("plans/bar/plan.json"));
  plan.erase("mesh_sha256");
  plan["version"] = 4;
  plan["model"] = "linear_elastic";
  plan["stiffness"] = {{"uniform", 15000}};
  plan["fixed"] = {{"vertices", PartedBlock::Fixed()}};
  plan["handles"] = {{{"name", "top"}, {"region", {{"vertices", PartedBlock::Top()}}}}};
  plan["contact"] = ContactToJson(block.rows, {"top"}, CoordinateSystem::kLps);
  plan["contact"]["seal"] = LipEdgeToJson(block.Edge(), CoordinateSystem::kLps);
  Write("plan.json", plan.dump());
  const int32_t lower = block.Edge().pairs[1].lower;
  targets_["free"] = {{{"handle", "top"}, {"translation_mm", {nullptr, nullptr, {0, 2}}}}};
  targets_["targets"] = {
      {{"name", "edge"}, {"at", {{"vertices", {lower}}}}, {"along", {0, 0, 1}}, {"by_mm", 0.2}}};
  targets_["less_movement"] = 0;
  targets_["tolerance_mm"] = 0.001;
  EXPECT_THAT(Fit({"--out", "free.json"}).err, HasSubstr("edge")) << "parted lips stay behind";

  const ProcessResult result = Fit({"--seal", "--out", "fitted.json", "--report", "report.json"});
  ASSERT_THAT(result, Succeeds());
  EXPECT_THAT(result.out, HasSubstr("\nsealed: 3 pairs, released: no\n"));
  EXPECT_EQ(ReadJson(Path("report.json"))["seal"]["pairs"], 3);
  const auto height = [&](const std::vector<std::string>& more) {
    std::vector<std::string> words = {"deform", "fitted.json", "--out", "after.vtu"};
    words.insert(words.end(), more.begin(), more.end());
    EXPECT_THAT(Run(words), Succeeds());
    return ReadTetMesh(Path("after.vtu"))->mesh.positions()(lower, 2);
  };
  EXPECT_NEAR(height({"--seal"}), 2.2, 0.001);
  EXPECT_LT(height({}), 2.1);
}

TEST_F(PlanFitTest, KnownPoseOfABundledHeadIsFoundAgain) {
  const std::string head = TestDataPath("plans/head");
  Json plan = ReadJson(head + "/plan.json");
  plan["mesh"] = head + "/head.vtu";
  const TetMeshFile before = *ReadTetMesh(head + "/head.vtu");
  const std::vector<int32_t> jaw = [&] {
    std::vector<int32_t> vertices;
    const auto anatomy = *FindScalars(before.point_data, "anatomy", "point");
    for (size_t v = 0; v < anatomy.size(); ++v) {
      if (anatomy[v] == 2) vertices.push_back(static_cast<int32_t>(v));
    }
    return vertices;
  }();
  const Vector3d middle = before.mesh.positions()(jaw, Eigen::all).colwise().mean();
  plan["handles"][0]["pose"] = {{"pivot_mm", {middle.x(), middle.y(), middle.z()}},
                                {"rotation_vector_deg", {-2, 1.5, 1}},
                                {"translation_mm", {1, -5, 0.5}}};
  Write("plan.json", plan.dump());
  ASSERT_THAT(Run({"deform", "plan.json", "--out", "after.vtu", "--allow-outside"}), Succeeds());
  const TetMeshFile after = *ReadTetMesh(Path("after.vtu"));
  ASSERT_OK_AND_ASSIGN(const std::vector<SkinPlace> places, SkinPlaces(before.point_data));
  targets_["targets"] = Json::array();
  for (const SkinPlace& place : places) {
    const Vector3d moved =
        (after.mesh.positions() - before.mesh.positions())(place.vertices, Eigen::all)
            .colwise()
            .mean();
    targets_["targets"].push_back({{"name", place.name},
                                   {"at", {{"place", place.name}}},
                                   {"move_mm", {moved.x(), moved.y(), moved.z()}}});
  }
  targets_["free"][0]["handle"] = "mandible";
  targets_["less_movement"] = 1e-4;
  plan["handles"][0].erase("pose");
  Write("plan.json", plan.dump());
  const ProcessResult result = Fit({"--json", "--allow-outside"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Json pose = Json::parse(result.out)["handles"][0]["pose"];
  EXPECT_LT((ToVector(pose["translation_mm"]) - Vector3d(1, -5, 0.5)).norm(), 0.01);
  EXPECT_LT((ToVector(pose["rotation_vector_deg"]) - Vector3d(-2, 1.5, 1)).norm(), 0.01);
}

}  // namespace
}  // namespace tissueform::testing
