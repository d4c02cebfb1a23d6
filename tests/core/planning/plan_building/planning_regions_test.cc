// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/planning_regions.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/imaging/anatomy/bone_parts.h"
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
    return AssignRegions(mesh, mesh.num_vertices(), soft_tissue, {"piece"}, {.contact_mm = band_mm},
                         Landmarks(), {hu, -500});
  }

  double Height(Eigen::Index v) const { return mesh.positions()(v, 2); }

  TetMesh mesh;
  SoftTissue soft_tissue;
  HuGrid hu;
};

// A bar of tissue, 2 by 2 by 40 mm, along one bone that is cut at half its height: what is below
// stays, what is above moves. In front and beside is air.
struct CutBone {
  explicit CutBone(uint8_t part_below) : mesh(testing::Bar({1, 1, 20}, 2.0)) {
    GridGeometry geometry;
    geometry.size = {2 + 2 * kMargin, 2 + 2 * kMargin, 40 + 2 * kMargin};
    geometry.origin_mm = Eigen::Vector3d::Constant(0.5 - kMargin);
    soft_tissue.labels = LabelGrid(geometry);
    parts = LabelGrid(geometry);
    hu = HuGrid(geometry, -1000);
    ForEachVoxelOf(geometry, [&](const Eigen::Vector3i& at, const Eigen::Vector3d& p) {
      const bool is_below = p.z() < kCutMm;
      uint8_t& label = soft_tissue.labels.At(at.x(), at.y(), at.z());
      if (p.x() < 0) {
        label = is_below ? kFixedBone : kFirstSegment;
        parts.At(at.x(), at.y(), at.z()) = is_below ? part_below : kMandible;
      } else if (p.x() < 2 && p.y() > 0 && p.y() < 2 && p.z() > 0 && p.z() < 40) {
        label = kSoftTissue;
      }
      if (label != 0) hu.At(at.x(), at.y(), at.z()) = label == kSoftTissue ? 50 : 1000;
    });
    const Plane above_all{Eigen::Vector3d(0, 0, -1000), Eigen::Vector3d::UnitZ()};
    soft_tissue.region = {above_all, above_all, above_all};
  }

  template <typename Function>
  static void ForEachVoxelOf(const GridGeometry& geometry, Function call) {
    for (int z = 0; z < geometry.size[2]; ++z) {
      for (int y = 0; y < geometry.size[1]; ++y) {
        for (int x = 0; x < geometry.size[0]; ++x) call({x, y, z}, geometry.Centre(x, y, z));
      }
    }
  }

  // Of the vertices on the bone, from below: 0 free, 1 held by what stays, 2 by the piece.
  std::vector<int> Held(double dissected_mm) const {
    const absl::StatusOr<PlanningRegions> regions =
        AssignRegions(mesh, mesh.num_vertices(), soft_tissue, {"piece"},
                      {.contact_mm = 3, .dissected_mm = {dissected_mm}, .parts = &parts},
                      Landmarks(), {hu, -500});
    EXPECT_THAT(regions, IsOk());
    std::vector<int> held(21, -1);
    for (Eigen::Index v = 0; regions.ok() && v < mesh.num_vertices(); ++v) {
      if (mesh.positions()(v, 0) != 0 || mesh.positions()(v, 1) != 2) continue;
      held[std::lround(mesh.positions()(v, 2) / 2)] = regions->anatomy[v];
    }
    return held;
  }

  static constexpr double kCutMm = 21;  // between two rows of vertices
  TetMesh mesh;
  SoftTissue soft_tissue;
  LabelGrid parts;
  HuGrid hu;
};

std::vector<int> HeldUpTo(int last_fixed, int first_of_piece) {
  std::vector<int> held(21, 0);
  std::fill_n(held.begin(), last_fixed + 1, kFixedBone);
  std::fill(held.begin() + first_of_piece, held.end(), kFirstSegment);
  return held;
}

TEST(PlanningRegionsTest, ACutIsFreeOnBothSidesWhereNothingIsDissected) {
  // Rows are 2 mm apart; those at 20 and 22 mm are within 3 mm of voxels beyond the cut at 21.
  EXPECT_EQ(CutBone(kMandible).Held(0), HeldUpTo(9, 12));
}

TEST(PlanningRegionsTest, DissectedBoneIsFreeAndThePieceHoldsUpToTheCut) {
  EXPECT_EQ(CutBone(kMandible).Held(8), HeldUpTo(6, 11));
}

TEST(PlanningRegionsTest, BoneOfTheOtherJawIsNotDissected) {
  EXPECT_EQ(CutBone(kCranium).Held(8), HeldUpTo(9, 12));
}

TEST(PlanningRegionsTest, BoneHoldsAdjacentVerticesAndAirHoldsNone) {
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

TEST(PlanningRegionsTest, CutsAreFixedAndNotSkin) {
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

TEST(PlanningRegionsTest, BorderToOmittedTissueIsNotSkin) {
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

TEST(PlanningRegionsTest, RefusesTetsBetweenTwoBonesWithoutFreeVertices) {
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
