// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/plan_measures.h"

#include <algorithm>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mesh/tet_quality.h"
#include "tests/core/planning/plan_report/plan_build_of_mesh.h"
#include "tests/testing/meshes.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

// A bar of 3 x 3 x 4 cubes of 1 mm as if it were the soft tissue of a head.
PlanBuild BuildOfBar(const TetMesh& mesh) {
  PlanBuild build = testing::PlanBuildOfMesh(mesh);
  build.head.hu.geometry.spacing_mm = 2;
  build.parts.labels = LabelGrid({.size = {2, 2, 1}, .spacing_mm = 2});
  build.parts.labels.values = {kCranium, kMandible, kMandible, 0};
  build.soft_tissue.volume_mm3 = 36;
  build.stiffness.tissue.assign(static_cast<size_t>(mesh.num_tets()), 1);
  build.stiffness.tissue[0] = 0;
  build.skin_distance.mm = {1, 3};
  build.skin_distance.mean_mm = 1;
  build.skin_distance.p99_mm = 3;
  return build;
}

std::vector<bool> Passed(const PlanBuild& build) {
  std::vector<bool> passed;
  for (const QualityCheck& check : CheckQuality(build, MeasurePlan(build))) {
    passed.push_back(check.passed);
  }
  return passed;
}

TEST(PlanMeasuresTest, CubesAreMeasuredAsCubes) {
  const PlanBuild build = BuildOfBar(testing::Bar({3, 3, 4}));
  const PlanMeasures measures = MeasurePlan(build);
  EXPECT_EQ(measures.inverted_tets, 0);
  EXPECT_EQ(measures.components, 1);
  EXPECT_NEAR(measures.ratio_to_voxels, 1, 1e-12);
  EXPECT_EQ(measures.share_over_3_deg, 1);
  EXPECT_NEAR(*std::min_element(measures.smallest_dihedral_deg.begin(),
                                measures.smallest_dihedral_deg.end()),
              45, 1e-9);  // six tets a cube
  EXPECT_EQ(measures.bone_mm3[kCranium], 8);
  EXPECT_EQ(measures.bone_mm3[kMandible], 16);
  EXPECT_THAT(measures.tets_of_tissue, ElementsAre(1, 6 * 36 - 1, 0));
  EXPECT_THAT(measures.skin_voxels, ElementsAre(0.5, 1.5));
}

TEST(PlanMeasuresTest, SurfacesHaveNoSlicesAndNoObjects) {
  PlanBuild build = BuildOfBar(testing::Bar({3, 3, 4}));
  build.surface_roles = {"skin"};
  const std::vector<QualityCheck> checks = CheckQuality(build, MeasurePlan(build));
  EXPECT_EQ(checks.size(), 10U);
  for (const QualityCheck& check : checks) {
    EXPECT_THAT(check.name, AllOf(Not(HasSubstr("CT")), Not(HasSubstr("Objects"))));
  }
  EXPECT_EQ(checks[6].name, "Given skin within 0.0 mm of the mesh's, as a whole");
}

TEST(PlanMeasuresTest, EveryRequirementCanFail) {
  PlanBuild build = BuildOfBar(testing::Bar({3, 3, 4}));
  EXPECT_THAT(Passed(build),
              ElementsAre(true, true, true, true, true, true, true, true, true, true, true, true));
  build.soft_tissue.volume_mm3 = 37.5;
  build.skin_distance.mean_mm = 1.3;
  build.skin_distance.p99_mm = 4.1;
  EXPECT_THAT(Passed(build), ElementsAre(true, true, true, false, false, false, true, true, true,
                                         true, true, true));
  EXPECT_FALSE(AllPassed(CheckQuality(build, MeasurePlan(build))));
  EXPECT_THAT(FailedText(CheckQuality(build, MeasurePlan(build))),
              HasSubstr("mean: 0.65 voxels (1.30 mm), not at most 0.6 voxels; "));

  // An inverted tet, without an angle to speak of, that hangs on nothing.
  const TetMesh bar = testing::Bar({3, 3, 4});
  Positions positions(bar.num_vertices() + 4, 3);
  positions << bar.positions(), Positions{{9, 0, 0}, {10, 0, 0}, {9, 1, 0}, {9.3, 0.3, -0.001}};
  TetIndices tets(bar.num_tets() + 1, 4);
  const auto first = static_cast<int32_t>(bar.num_vertices());
  tets << bar.tets(), TetIndices{{first, first + 1, first + 2, first + 3}};
  build = BuildOfBar(*TetMesh::Create(positions, tets));
  EXPECT_THAT(Passed(build), ElementsAre(false, false, false, true, true, true, true, true, true,
                                         true, true, true));

  build = BuildOfBar(bar);
  build.coverage.whole.area_mm2 = 100;
  build.coverage.regions[0].area_mm2 = 100;
  build.coverage.gaps = {{SkinRegion::kNone, 100, 5, {}}};
  build.coverage.holes = build.coverage.gaps;
  EXPECT_THAT(Passed(build), ElementsAre(true, true, true, true, true, true, true, false, false,
                                         false, false, true));

  build = BuildOfBar(bar);
  build.soft_tissue.labels = LabelGrid({.size = {1, 1, 1}}, kSoftTissue);
  build.ct.wide_gaps = {{Eigen::Vector3d::UnitZ(), -4, 3, 7}};
  EXPECT_THAT(Passed(build),
              ElementsAre(true, true, true, true, true, true, false, true, true, true, true, true));
  EXPECT_THAT(FailedText(CheckQuality(build, MeasurePlan(build))), HasSubstr("up to 7.00 mm"));

  build = BuildOfBar(bar);
  build.soft_tissue.region = {{{0, 9, 0}, -Eigen::Vector3d::UnitY()},
                              {{0, 0, 9}, -Eigen::Vector3d::UnitZ()},
                              {{0, 0, -9}, Eigen::Vector3d::UnitZ()}};
  AttachedObject piece;
  piece.contact_mm = {Eigen::Vector3d::Zero()};
  piece.face_mm2 = 30;
  build.head.objects = {piece};
  EXPECT_THAT(Passed(build),
              ElementsAre(true, true, true, true, true, true, true, true, true, true, true, false));
}

}  // namespace
}  // namespace tissueform
