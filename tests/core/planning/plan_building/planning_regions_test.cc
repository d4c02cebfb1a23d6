// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/planning_regions.h"

#include <algorithm>
#include <cmath>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/imaging/anatomy/osteotomy.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::IsOk;
using testing::StatusIs;

constexpr int kMargin = 6;

// A column of tissue, 2 by 2 by `height` mm, on bone that stays, under a segment, in air.
struct Column {
  explicit Column(int height) : mesh(testing::Bar({1, 1, height / 2}, 2.0)) {
    GridGeometry geometry;
    geometry.size = {2 + 2 * kMargin, 2 + 2 * kMargin, height + 2 * kMargin};
    geometry.origin_mm = Eigen::Vector3d::Constant(0.5 - kMargin);
    soft_tissue.labels = LabelGrid(geometry);
    hu = HuGrid(geometry, -1000);
    for (int z = 0; z < geometry.size[2]; ++z) {
      for (int y = 0; y < geometry.size[1]; ++y) {
        for (int x = 0; x < geometry.size[0]; ++x) {
          const Eigen::Vector3d p = geometry.Centre(x, y, z);
          const bool beside = p.x() < 0 || p.x() > 2 || p.y() < 0 || p.y() > 2;
          uint8_t& label = soft_tissue.labels.At(x, y, z);
          // Bone reaches a little round the column's ends, so that its edges are nearer than air.
          if (p.z() < (beside ? 1 : 0)) label = kFixedBone;
          if (p.z() > height - (beside ? 1 : 0)) label = kFirstSegment;
          if (label == 0 && !beside) label = kSoftTissue;
          if (label != 0) hu.At(x, y, z) = label == kSoftTissue ? 50 : 1000;
        }
      }
    }
    const Eigen::Vector3d far(0, 0, -1000);
    const Plane above_all{far, Eigen::Vector3d::UnitZ()};
    soft_tissue.region = {above_all, above_all, above_all};
  }

  absl::StatusOr<PlanningRegions> Assign(double band_mm) const {
    return AssignRegions(mesh, mesh.num_vertices(), soft_tissue, {"piece"}, band_mm, Landmarks(),
                         {hu, -500});
  }

  double Height(Eigen::Index v) const { return mesh.positions()(v, 2); }

  TetMesh mesh;
  SoftTissue soft_tissue;
  HuGrid hu;
};

TEST(PlanningRegionsTest, BoneHoldsWhatTouchesItAndAirNothing) {
  const Column column(20);
  ASSERT_OK_AND_ASSIGN(const PlanningRegions regions, column.Assign(3));
  for (Eigen::Index v = 0; v < column.mesh.num_vertices(); ++v) {
    const double z = column.Height(v);
    const int expected = z == 0 ? kFixedBone : z == 20 ? kFirstSegment : 0;
    EXPECT_EQ(regions.anatomy[v], expected) << z;
    EXPECT_EQ(regions.bone[v], expected) << z;
    EXPECT_EQ(regions.on_skin[v], expected == 0) << z;
  }
  EXPECT_EQ(regions.freed_by_contact, 0);
}

TEST(PlanningRegionsTest, CutsAreFixedAndNoSkin) {
  Column column(20);
  column.soft_tissue.region.below = {{0, 0, 9.7}, Eigen::Vector3d::UnitZ()};
  ASSERT_OK_AND_ASSIGN(const PlanningRegions regions, column.Assign(1));
  for (Eigen::Index v = 0; v < column.mesh.num_vertices(); ++v) {
    if (column.Height(v) > 10 || column.Height(v) == 0) continue;
    EXPECT_EQ(regions.anatomy[v], kFixedBone);
    EXPECT_FALSE(regions.on_skin[v]);
  }
}

TEST(PlanningRegionsTest, CutsNearASegmentAreFree) {
  Column column(20);
  column.soft_tissue.region.below = {{0, 0, 15.7}, Eigen::Vector3d::UnitZ()};
  ASSERT_OK_AND_ASSIGN(const PlanningRegions regions, column.Assign(2));
  for (Eigen::Index v = 0; v < column.mesh.num_vertices(); ++v) {
    if (column.Height(v) == 16) {
      EXPECT_EQ(regions.anatomy[v], 0);
    } else if (column.Height(v) == 10) {
      EXPECT_EQ(regions.anatomy[v], kFixedBone);
    }
  }
}

TEST(PlanningRegionsTest, TissueThatIsLeftOutIsNoSkin) {
  Column column(20);
  std::fill(column.hu.values.begin(), column.hu.values.end(), int16_t{40});  // brain instead of air
  ASSERT_OK_AND_ASSIGN(const PlanningRegions regions, column.Assign(3));
  EXPECT_EQ(std::count(regions.on_skin.begin(), regions.on_skin.end(), true), 0);
}

TEST(PlanningRegionsTest, BonesNearOneAnotherLeaveBothSidesFree) {
  Column column(6);
  EXPECT_THAT(column.Assign(5), IsOk());
  EXPECT_THAT(column.Assign(9), StatusIs(absl::StatusCode::kInvalidArgument,
                                         AllOf(HasSubstr("contact band of 9 mm"),
                                               HasSubstr("smaller \"contact_band_mm\""))));
}

TEST(PlanningRegionsTest, ATetIsNotHeldByTwo) {
  const Column column(2);  // every tet reaches from bone to bone
  EXPECT_THAT(column.Assign(0),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no vertices left")));
}

TEST(PlanningRegionsTest, LargestMoveIsThatOfTheFarthestVoxel) {
  LabelGrid labels;
  labels.geometry.size = {11, 2, 2};
  labels = LabelGrid(labels.geometry);
  labels.At(0, 0, 0) = kFirstSegment;
  labels.At(10, 0, 0) = kFirstSegment;
  labels.At(5, 0, 0) = kFixedBone;
  HandlePose pose;
  pose.rotation_vector = {0, 0, EIGEN_PI / 2};
  EXPECT_NEAR(LargestMoveMm(labels, kFirstSegment, pose), 10 * std::sqrt(2.0), 1e-12);
  EXPECT_NEAR(LargestMoveMm(labels, kFixedBone, pose), 5 * std::sqrt(2.0), 1e-12);
  EXPECT_EQ(LargestMoveMm(labels, kFirstSegment + 1, pose), 0);
  EXPECT_EQ(LargestMoveMm(labels, kFirstSegment, HandlePose()), 0);
}

}  // namespace
}  // namespace tissueform
