// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cstdlib>
#include <filesystem>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include <sys/wait.h>

#include "client/cli/predict/slicer_scene.h"
#include "core/mesh/io/triangle_mesh_io.h"
#include "core/planning/plan_building/segment_move.h"
#include "tests/client/cli/predict/itk_transform.h"
#include "tests/testing/meshes.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;
using Json = nlohmann::json;

constexpr int kMissing = 77;

HandlePose APose() {
  HandlePose pose;
  pose.rotation_vector = {0.1, -0.05, 0.2};
  pose.pivot_mm = {-100, 40, -110};
  pose.translation_mm = {1, -6, 2};
  return pose;
}

// What ITK makes of a transform file: it maps points of the image after the movement to the image
// before it.
Eigen::Vector3d MappedByItk(const std::string& path, const Eigen::Vector3d& place) {
  const auto [x, y, z] = MapByItk(path, {place.x(), place.y(), place.z()});
  return {x, y, z};
}

class PlanExportTest : public CliTest {
 protected:
  // The lower face of the bundled head, so coarse that it takes seconds.
  void BuildHead() const {
    const HandlePose pose = APose();
    const auto list = [](const Eigen::Vector3d& v) { return Json{v.x(), v.y(), v.z()}; };
    const Json recipe = {{"format", "tissueform-recipe"},
                         {"version", 1},
                         {"ct", {{"hu_offset", -1024}, {"axes", "RPI"}}},
                         {"spacing_mm", 4},
                         {"mesh", {{"edge_mm", 8}, {"fine_edge_mm", 8}}},
                         {"segments",
                          {{{"name", "mandible"},
                            {"osteotomy", "bssro"},
                            {"pose",
                             {{"rotation_vector_deg", list(pose.rotation_vector * 180 / M_PI)},
                              {"pivot_mm", list(pose.pivot_mm)},
                              {"translation_mm", list(pose.translation_mm)}}}}}}};
    Write("recipe.json", recipe.dump());
    const ProcessResult built =
        Run({"plan", "build", "--ct", TestDataPath("ct/headsq/headsq_quarter.nhdr"), "--recipe",
             "recipe.json", "--out", "head", "--no-pictures", "--accept-defects"});
    ASSERT_EQ(built.exit_code, 0) << built.err;
  }
  std::set<std::string> FilesIn(const std::string& folder) const {
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder_ / folder)) {
      names.insert(entry.path().filename().string());
    }
    return names;
  }
  Eigen::Vector3d LandmarkIn(const std::string& file, const std::string& name) const {
    const Json markups = Json::parse(Read(file));
    for (const Json& point : markups["markups"][0]["controlPoints"]) {
      if (point["label"] != name) continue;
      const auto place = point["position"].get<std::vector<double>>();
      return {place[0], place[1], place[2]};
    }
    ADD_FAILURE() << name;
    return Eigen::Vector3d::Zero();
  }
};

TEST_F(PlanExportTest, SceneOfAHeadIsReadByOthers) {
  BuildHead();
  const ProcessResult result =
      Run({"plan", "export", "--slicer", "scene", "head/plan.json", "--model", "linear_elastic"});
  ASSERT_EQ(result.exit_code, 0) << result.err;

  const Eigen::Vector3d before = LandmarkIn("scene/landmarks.mrk.json", "pogonion");
  const Eigen::Vector3d after = LandmarkIn("scene/landmarks_predicted.mrk.json", "pogonion");
  EXPECT_LT((ApplyPose(APose(), before) - after).norm(), 1e-6);
  EXPECT_LT((MappedByItk(Path("scene/mandible.tfm"), after) - before).norm(), 1e-6);
  const Eigen::Vector3d skin = LandmarkIn("scene/landmarks_predicted.mrk.json", "soft_pogonion") -
                               LandmarkIn("scene/landmarks.mrk.json", "soft_pogonion");
  EXPECT_LT(skin.y(), -3);

  // The scene names each file, and no other.
  const std::string scene = Read("scene/scene.mrml");
  std::set<std::string> named = {"scene.mrml"};
  const std::regex file_name("fileName=\"([^\"]+)\"");
  for (auto i = std::sregex_iterator(scene.begin(), scene.end(), file_name);
       i != std::sregex_iterator(); ++i) {
    named.insert((*i)[1]);
  }
  EXPECT_EQ(named, FilesIn("scene"));
  for (const std::string& file : named) {
    if (!file.ends_with(".vtp") || file == "face.vtp") {
      EXPECT_THAT(Read("scene/" + file), HasSubstr("not a medical device")) << file;
    }
  }
  EXPECT_THAT(Read("scene/mandible.ply"), HasSubstr("SPACE=LPS"));

  const std::string check = SourcePath("tests/client/cli/predict/open_scene.py");
  const int status =
      std::system(absl::StrCat("/usr/bin/python3 '", check, "' '", Path("scene"), "'").c_str());
  const int exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  ASSERT_NE(exit_code, kMissing) << "python3-vtk9 or python3-meshio is missing";
  EXPECT_EQ(exit_code, 0);
}

// What goes out comes in again: the exported piece and transform give the plan's movement.
TEST_F(PlanExportTest, TransformComesBackAsTheMovement) {
  Write("jaw.tfm", ItkTransformText(APose()));
  const absl::StatusOr<RigidMove> move = ParseItkTransform(Read("jaw.tfm"));
  ASSERT_THAT(move.status(), IsOk());
  const Eigen::Vector3d place(-90, 20, -100);
  EXPECT_LT((move->rotation * place + move->translation_mm - ApplyPose(APose(), place)).norm(),
            1e-9);
  EXPECT_LT((MappedByItk(Path("jaw.tfm"), ApplyPose(APose(), place)) - place).norm(), 1e-9);
}

TEST_F(PlanExportTest, PlanWithoutAViewerFileShowsItsMesh) {
  const ProcessResult result =
      Run({"plan", "export", "--slicer", "scene", TestDataPath("plans/bar/plan.json")});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(FilesIn("scene"), ::testing::Contains("face_predicted.vtp"));
  const auto face = ReadTriangleMesh(Path("scene/face_predicted.vtp"));
  ASSERT_THAT(face.status(), IsOk());
  EXPECT_NE(FindAttribute(face->point_data, "displacement_mm"), nullptr);
  // The folder is full by now.
  EXPECT_THAT(Run({"plan", "export", "--slicer", "scene", TestDataPath("plans/bar/plan.json")}),
              FailsWith(1, HasSubstr("scene")));
  EXPECT_THAT(Run({"plan", "export", "--slicer", "other", "none.json"}),
              FailsWith(1, HasSubstr("none.json")));
  EXPECT_FALSE(std::filesystem::exists(Path("other")));
}

}  // namespace
}  // namespace tissueform::testing
