// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/skin_coverage.h"

#include <cmath>
#include <numbers>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/imaging/anatomy/surface_extraction.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::StatusIs;

constexpr double kBallMm = 40;
constexpr double kPi = std::numbers::pi;

// A ball of soft tissue with a closed hollow of 15 mm; its skin is at -500 HU.
HeadSegmentation Ball() {
  HeadSegmentation head;
  head.hu = HuGrid(
      {.size = {70, 70, 70}, .origin_mm = Eigen::Vector3d::Constant(-51.7), .spacing_mm = 1.5});
  ForEachVoxel(LabelGrid(head.hu.geometry, 1), [&](size_t index, const Eigen::Vector3d& place) {
    const double wall = std::min(kBallMm - place.norm(), place.norm() - 15);
    head.hu.values[index] =
        static_cast<int16_t>(std::lround(-500 + 1000 * std::clamp(wall / 3, -0.5, 0.5)));
  });
  head.bone = LabelGrid(head.hu.geometry);
  return head;
}

RegionOfInterest RegionAbove(double z_mm) {
  return {{{0, 500, 0}, -Eigen::Vector3d::UnitY()},
          {{0, 0, 500}, -Eigen::Vector3d::UnitZ()},
          {{0, 0, z_mm}, Eigen::Vector3d::UnitZ()}};
}

// All places are skin without a name.
Landmarks FarLandmarks() {
  Landmarks landmarks;
  landmarks.midsagittal = {{0, 0, 0}, Eigen::Vector3d::UnitX()};
  landmarks.upper_teeth = {{0, 0, 0}, Eigen::Vector3d::UnitZ()};
  const Eigen::Vector3d far(0, 0, 1000);
  for (auto* place : {&landmarks.nose_tip, &landmarks.subnasale, &landmarks.upper_lip,
                      &landmarks.lower_lip, &landmarks.skin_pogonion, &landmarks.menton}) {
    *place = far;
  }
  return landmarks;
}

// The boundary of a mesh: a ball, with skin where is_skin(vertex) holds.
class BallMesh {
 public:
  explicit BallMesh(double radius_mm) {
    FloatGrid field(Ball().hu.geometry);
    ForEachVoxel(LabelGrid(field.geometry, 1), [&](size_t index, const Eigen::Vector3d& place) {
      field.values[index] = static_cast<float>(radius_mm - place.norm());
    });
    surface_ = ExtractSurface(field).value();
    regions_.anatomy.assign(static_cast<size_t>(surface_.num_vertices()), 0);
    regions_.on_skin.assign(regions_.anatomy.size(), true);
    regions_.bone.assign(regions_.anatomy.size(), 0);
  }

  Eigen::Vector3d Vertex(size_t v) const {
    return surface_.positions().row(static_cast<Eigen::Index>(v));
  }
  PlanningRegions& regions() { return regions_; }

  absl::StatusOr<SkinCoverage> Coverage(const RegionOfInterest& region,
                                        double ct_voxel_mm = 1) const {
    return MeasureSkinCoverage(Ball(), FarLandmarks(), {surface_, regions_, region}, ct_voxel_mm);
  }

 private:
  TriangleMesh surface_ = *TriangleMesh::Create(Positions::Zero(3, 3), TriangleIndices{{0, 1, 2}});
  PlanningRegions regions_;
};

TEST(SkinCoverageTest, AWholeMeshHasTheWholeOuterSkinAndNotTheHollows) {
  const BallMesh mesh(kBallMm);
  ASSERT_OK_AND_ASSIGN(const SkinCoverage coverage, mesh.Coverage(RegionAbove(-500)));
  EXPECT_NEAR(coverage.whole.area_mm2, 4 * kPi * kBallMm * kBallMm, 200);
  EXPECT_EQ(coverage.whole.share(), 1);
  EXPECT_LT(coverage.whole.largest_mm, 0.2);
  EXPECT_THAT(coverage.gaps, IsEmpty());
  EXPECT_THAT(coverage.holes, IsEmpty());
  EXPECT_EQ(coverage.mesh_skin_on_bone_mm2, 0);
  EXPECT_EQ(coverage.regions.front().area_mm2, coverage.whole.area_mm2);
}

TEST(SkinCoverageTest, OnlyTheRegionIsMeasured) {
  const BallMesh mesh(kBallMm);
  ASSERT_OK_AND_ASSIGN(const SkinCoverage coverage, mesh.Coverage(RegionAbove(10)));
  // A cap of 40 - 10 mm, less the margin of a voxel.
  EXPECT_NEAR(coverage.whole.area_mm2, 2 * kPi * kBallMm * (30 - 1.5), 100);
  EXPECT_THAT(mesh.Coverage(RegionAbove(45)),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("outer skin")));
}

TEST(SkinCoverageTest, AMeshThatIsTooSmallIsOutOfReachOfTheTolerance) {
  const BallMesh mesh(kBallMm - 2);
  ASSERT_OK_AND_ASSIGN(const SkinCoverage fine, mesh.Coverage(RegionAbove(-500)));
  EXPECT_EQ(fine.tolerance_mm, 1.5);
  EXPECT_LT(fine.whole.share(), 0.01);
  EXPECT_NEAR(fine.whole.largest_mm, 2, 0.2);
  ASSERT_OK_AND_ASSIGN(const SkinCoverage coarse, mesh.Coverage(RegionAbove(-500), 2.5));
  EXPECT_EQ(coarse.tolerance_mm, 2.5);
  EXPECT_EQ(coarse.whole.share(), 1);
}

// No skin where the angle to the axis z is under 0.4: what is missing ends at a rim, from which the
// distance is a chord.
TEST(SkinCoverageTest, AGapIsMeasuredToItsRim) {
  constexpr double kAngle = 0.4;
  BallMesh mesh(kBallMm);
  for (size_t v = 0; v < mesh.regions().on_skin.size(); ++v) {
    const double angle = std::acos(mesh.Vertex(v).normalized().z());
    if (angle < kAngle) mesh.regions().on_skin[v] = false;
  }
  ASSERT_OK_AND_ASSIGN(const SkinCoverage coverage, mesh.Coverage(RegionAbove(-500)));
  const auto cap_mm2 = [](double angle) {
    return 2 * kPi * kBallMm * kBallMm * (1 - std::cos(angle));
  };
  const auto angle_of_chord = [](double mm) { return 2 * std::asin(mm / 2 / kBallMm); };
  ASSERT_EQ(coverage.gaps.size(), 1U);
  ASSERT_EQ(coverage.holes.size(), 1U);
  // Triangles that are half skin reach into the cap by up to an edge, of at most 2.6 mm.
  EXPECT_LE(coverage.gaps[0].largest_mm, 2 * kBallMm * std::sin(kAngle / 2));
  EXPECT_GE(coverage.gaps[0].largest_mm, 2 * kBallMm * std::sin(kAngle / 2) - 2.6);
  const double edge = 0.7 / kBallMm;
  EXPECT_NEAR(coverage.gaps[0].area_mm2, cap_mm2(kAngle - edge - angle_of_chord(kGapMm)), 40);
  EXPECT_NEAR(coverage.holes[0].area_mm2, cap_mm2(kAngle - edge - angle_of_chord(kHoleMm)), 50);
  EXPECT_NEAR((coverage.gaps[0].farthest - Eigen::Vector3d(0, 0, kBallMm)).norm(), 0, 3);
  EXPECT_NEAR(coverage.gaps[0].hu_behind, 0, 60);  // of the ball: 0, and its blur
  EXPECT_EQ(coverage.whole.largest_mm, coverage.gaps[0].largest_mm);
}

TEST(SkinCoverageTest, BoneInTheSkinIsCounted) {
  BallMesh mesh(kBallMm);
  for (size_t v = 0; v < mesh.regions().on_skin.size(); ++v) {
    if (mesh.Vertex(v).x() > 20) mesh.regions().bone[v] = 1;
  }
  ASSERT_OK_AND_ASSIGN(const SkinCoverage coverage, mesh.Coverage(RegionAbove(-500)));
  EXPECT_NEAR(coverage.mesh_skin_on_bone_mm2 / coverage.mesh_skin_mm2, 0.25, 0.01);
}

}  // namespace
}  // namespace tissueform
