// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/experiments/ratios_experiment.h"

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/atomic_file.h"
#include "core/mesh/bar_mesh.h"
#include "core/mesh/io/tet_mesh_io.h"
#include "core/planning/case_file/mesh_surfaces.h"
#include "core/planning/case_file/viewer_file.h"
#include "core/planning/plan_io.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::IsOk;
using ::testing::Not;
using testing::StatusIs;

constexpr char kPlan[] = R"({
  "format": "tissueform-plan", "version": 1, "unit": "mm", "coordinate_system": "LPS",
  "mesh": "bar.vtu", "stiffness": {"uniform": 5000}, "poisson_ratio": 0.3,
  "fixed": {"point_data": "anatomy", "equals": 1},
  "handles": [{"name": "mandible", "region": {"point_data": "anatomy", "equals": 2},
               "pose": {"translation_mm": [0, -6, 0]}}],
  "model": "gradient_field"})";

// A bar of 4 x 4 x 20 mm between bone that stays and a lower jaw. Everything in it is as far along
// as its height, so the ratio of a point is its share of the height.
class RatiosOfABarTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = ::testing::TempDir() + "ratios_experiment_test";
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
    ASSERT_OK_AND_ASSIGN(const TetMesh mesh, BarMesh(CubeGrid({4, 4, 20}, 1)));
    std::vector<uint8_t> anatomy;
    for (const double z : mesh.positions().col(2)) {
      anatomy.push_back(z == 0 ? 1 : static_cast<uint8_t>(z == 20 ? 2 : 0));
    }
    ASSERT_THAT(
        WriteTetMesh(folder_ + "/bar.vtu", {.mesh = mesh,
                                            .point_data = {{.name = "anatomy", .values = anatomy}},
                                            .cell_data = {}}),
        IsOk());
    ASSERT_THAT(WriteFileAtomically(PlanPath(), kPlan), IsOk());
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string PlanPath() const { return folder_ + "/plan.json"; }

  // A viewer file with landmarks at these heights of the bar's side.
  void WriteViewer(const std::vector<std::pair<std::string, double>>& landmarks) {
    ASSERT_OK_AND_ASSIGN(const Plan plan, ReadPlan(PlanPath()));
    ASSERT_OK_AND_ASSIGN(const PlanProblem problem, ResolvePlan(plan));
    CaseSurface skin = *SkinOfMesh(*problem.mesh, problem.constraints, {});
    skin.follows.reset();
    ViewerFile viewer;
    for (const auto& [name, height] : landmarks) {
      const Eigen::RowVector3f place(2, 0, static_cast<float>(height));
      Eigen::Index vertex = 0;
      (skin.positions.rowwise() - place).rowwise().norm().minCoeff(&vertex);
      viewer.landmarks.push_back({.name = name,
                                  .label = name,
                                  .position_mm = place.cast<double>().transpose(),
                                  .skin_vertex = static_cast<int32_t>(vertex)});
    }
    viewer.surfaces = {std::move(skin)};
    ASSERT_OK_AND_ASSIGN(viewer.mesh_file_sha256, MeshFileSha256(folder_ + "/bar.vtu"));
    ASSERT_OK_AND_ASSIGN(const std::string bytes, SerializeViewer(viewer));
    ASSERT_THAT(WriteFileAtomically(folder_ + "/" + kViewerFile, bytes), IsOk());
  }

  std::string folder_;
};

TEST_F(RatiosOfABarTest, APointHalfwayToTheJawMovesByHalf) {
  WriteViewer({{"labrale_inferius", 12}, {"soft_pogonion", 19}});
  CsvTable table = RatioTable();
  ASSERT_THAT(AddRatiosOfPlan("bar", PlanPath(), 1, &table), IsOk());
  const std::string csv = table.Csv();
  // Published: 0.53 to 0.66 and 0.9 to 1 forward, 0.92 to 1.05 back. The last model is the one
  // whose answer is linear in the height.
  EXPECT_THAT(csv, HasSubstr("bar,mandible 6 mm forward,labrale_inferius,0.53 to 0.66,"));
  EXPECT_THAT(csv, HasSubstr(",0.60,-,-,-\nbar,mandible 6 mm forward,soft_pogonion"));
  EXPECT_THAT(csv, HasSubstr(",0.95,-,-,-\nbar,mandible 6 mm back,labrale_inferius"));
  EXPECT_THAT(csv, HasSubstr(",0.60 outside,-,-,-\nbar,mandible 6 mm back,soft_pogonion"));
  EXPECT_THAT(csv, Not(HasSubstr("maxilla")));
}

TEST_F(RatiosOfABarTest, APlanWithoutLandmarksIsAnError) {
  CsvTable table = RatioTable();
  EXPECT_THAT(AddRatiosOfPlan("bar", PlanPath(), 1, &table),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("viewer.glb")));
}

}  // namespace
}  // namespace tissueform
