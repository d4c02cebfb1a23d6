// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/prediction/face_movement.h"

#include <algorithm>
#include <cmath>

#include "core/planning/plan_io.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAreArray;

PlanProblem ProblemOf(const std::string& plan) {
  return ResolvePlan(ReadPlan(TestDataPath("plans/" + plan + "/plan.json")).value()).value();
}

TEST(FaceMovementTest, HeadHasAllRegionsAndTheTongueNone) {
  ASSERT_OK_AND_ASSIGN(const auto regions, FaceRegions(ProblemOf("head_chin")));
  std::vector<std::string> names;
  names.reserve(regions.size());
  for (const ComparedRegion& region : regions) names.push_back(region.name);
  EXPECT_THAT(names,
              ElementsAre("chin", "lower lip", "upper lip", "nose", "left cheek", "right cheek"));
  EXPECT_THAT(FaceRegions(ProblemOf("tongue")).value(), IsEmpty());
}

TEST(FaceMovementTest, RegionsOfThreeComponentsAreRefused) {
  PlanProblem tongue = ProblemOf("tongue");
  const auto values = static_cast<size_t>(3 * tongue.mesh->num_vertices());
  tongue.point_data.push_back({"skin_region", 3, std::vector<uint8_t>(values, 1)});
  const absl::Status refused = FaceRegions(tongue).status();
  EXPECT_TRUE(absl::IsInvalidArgument(refused));
  EXPECT_THAT(refused.message(), HasSubstr("\"skin_region\" has 3 components"));
}

TEST(FaceMovementTest, RegionsLieWhereTheirNamesSay) {
  const PlanProblem head = ProblemOf("head_chin");
  const Positions& rest = head.mesh->positions();
  const std::vector<ComparedRegion> regions = FaceRegions(head).value();
  const auto middle = [&](size_t r) -> Eigen::Vector3d {
    return rest(regions[r].vertices, Eigen::all).colwise().mean();
  };
  for (size_t r = 0; r < 3; ++r) {
    EXPECT_LT(middle(r).z(), middle(r + 1).z()) << regions[r].name << " is below the next one";
  }
  EXPECT_GT(middle(4).x(), middle(5).x()) << "x points to the patient's left";
}

TEST(FaceMovementTest, RegionsAreOnTheFreeSkin) {
  const PlanProblem head = ProblemOf("head_chin");
  const std::vector<int32_t> skin = FreeSkin(head);
  const std::vector<ComparedRegion> regions = FaceRegions(head).value();
  for (const auto& [name, vertices] : regions) {
    EXPECT_TRUE(std::includes(skin.begin(), skin.end(), vertices.begin(), vertices.end())) << name;
  }
}

TEST(FaceMovementTest, FreeSkinIsTheBoundaryWithoutTheHeldVertices) {
  // A bar of 3 x 3 x 4 vertices: one inner column; lowest and highest layer held.
  PlanProblem bar{.mesh = std::make_shared<const TetMesh>(Bar({2, 2, 3})),
                  .point_data = {},
                  .cell_data = {},
                  .written_in = CoordinateSystem::kLps,
                  .stiffness = {},
                  .constraints = BarEnds(Bar({2, 2, 3})),
                  .poses = {},
                  .deformer = {},
                  .uncertainty = {}};
  std::vector<int32_t> expected;
  for (int32_t v = 9; v < 27; ++v) {
    if (v % 9 != 4) expected.push_back(v);
  }
  EXPECT_THAT(FreeSkin(bar), UnorderedElementsAreArray(expected));
}

TEST(FaceMovementTest, ForemostIsTheSmallestYAtRestAndForwardIsMinusY) {
  Positions rest(3, 3);
  rest << 0, -5, 0, 1, -7, 0, 2, 9, 0;
  Positions deformed = rest;
  deformed.row(0) += Eigen::RowVector3d(0, -10, 0);  // before the other afterwards, not at rest
  deformed.row(1) += Eigen::RowVector3d(3, -4, 0);
  deformed.row(2) += Eigen::RowVector3d(0, 100, 0);  // of no region
  const std::vector<RegionMovement> movement = MeasureMovement({{"nose", {0, 1}}}, rest, deformed);
  ASSERT_EQ(movement.size(), 1U);
  EXPECT_EQ(movement[0].name, "nose");
  EXPECT_EQ(movement[0].vertices, 2);
  EXPECT_DOUBLE_EQ(movement[0].foremost.total_mm, 5);
  EXPECT_DOUBLE_EQ(movement[0].foremost.forward_mm, 4);
  EXPECT_DOUBLE_EQ(movement[0].mean.total_mm, 7.5);
  EXPECT_DOUBLE_EQ(movement[0].mean.forward_mm, 7);
}

}  // namespace
}  // namespace tissueform::testing
