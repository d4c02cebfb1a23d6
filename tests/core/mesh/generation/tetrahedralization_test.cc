// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/generation/tetrahedralization.h"

#include <limits>
#include <numbers>

#include "core/mesh/io/triangle_mesh_io.h"
#include "core/mesh/surface_validation.h"
#include "core/mesh/tet_quality.h"
#include "core/mesh/tet_topology.h"
#include "core/mesh/validation.h"
#include "tests/core/mesh/generation/surfaces.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/triangle_corners.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using tissueform::testing::BoxSurface;
using tissueform::testing::Corners;
using tissueform::testing::InsideOut;
using tissueform::testing::SphereSurface;
using tissueform::testing::StatusIs;
using tissueform::testing::Together;
using tissueform::testing::VolumeInside;
using tissueform::testing::WithHole;

double Volume(const TetMesh& mesh) { return TetVolumes(mesh.positions(), mesh.tets()).sum(); }

TEST(TetrahedralizationTest, SphereIsFilledWithGoodTetsAndKeepsItsSurface) {
  const TriangleMesh sphere = SphereSurface({5, -3, 2}, 10, 8);
  ASSERT_OK_AND_ASSIGN(const Tetrahedralization filled, Tetrahedralize(sphere));
  const TetMesh& mesh = filled.mesh;
  EXPECT_TRUE(ValidateTetMesh(mesh).defects.empty());
  EXPECT_NEAR(Volume(mesh), VolumeInside(sphere), 1e-9 * VolumeInside(sphere));
  EXPECT_EQ(mesh.positions().topRows(sphere.num_vertices()), sphere.positions());
  EXPECT_EQ(Corners(BoundaryFacets(mesh)), Corners(sphere.triangles()));
  EXPECT_GT(SummarizeTetQuality(mesh).min_dihedral_deg, 5);
  EXPECT_THAT(filled.region_of_tet, IsEmpty());
}

TEST(TetrahedralizationTest, SameSurfaceGivesTheSameMesh) {
  const TriangleMesh sphere = SphereSurface({0, 0, 0}, 10, 8);
  ASSERT_OK_AND_ASSIGN(const Tetrahedralization first, Tetrahedralize(sphere));
  ASSERT_OK_AND_ASSIGN(const Tetrahedralization second, Tetrahedralize(sphere));
  EXPECT_EQ(first.mesh.positions(), second.mesh.positions());
  EXPECT_EQ(first.mesh.tets(), second.mesh.tets());
}

TEST(TetrahedralizationTest, VolumeLimitHoldsForEveryTet) {
  TetrahedralizationOptions options;
  options.keep_surface = false;
  options.max_tet_volume_mm3 = RegularTetVolume(1.5);
  ASSERT_OK_AND_ASSIGN(const Tetrahedralization filled,
                       Tetrahedralize(BoxSurface({0, 0, 0}, {10, 10, 10}, 6), options));
  EXPECT_LE(SummarizeTetQuality(filled.mesh).max_volume_mm3, options.max_tet_volume_mm3);
  EXPECT_NEAR(Volume(filled.mesh), 1000, 1e-9);
}

TEST(TetrahedralizationTest, EdgeLengthsMakeTheMeshFinerWhereTheyAreShort) {
  const TriangleMesh box = BoxSurface({0, 0, 0}, {40, 10, 10}, 4);
  TetrahedralizationOptions options;
  options.keep_surface = false;
  for (const auto& p : box.positions().rowwise()) {
    options.edge_lengths_mm.push_back(p.x() < 15 ? 1.5 : 6);
  }
  ASSERT_OK_AND_ASSIGN(const Tetrahedralization filled, Tetrahedralize(box, options));
  int fine = 0;
  int coarse = 0;
  for (const auto& p : filled.mesh.positions().rowwise()) {
    fine += p.x() < 10 ? 1 : 0;
    coarse += p.x() > 30 ? 1 : 0;
  }
  EXPECT_GT(fine, 5 * coarse);
}

TEST(TetrahedralizationTest, EveryTetHasTheAttributeOfItsRegion) {
  // A box inside a box; the wall between them faces outwards, so it bounds no cavity.
  const TriangleMesh boxes =
      Together(BoxSurface({0, 0, 0}, {10, 10, 10}, 4), BoxSurface({3, 3, 3}, {7, 7, 7}, 2));
  TetrahedralizationOptions options;
  options.keep_surface = false;
  options.regions = {{Vector3d(1, 1, 1), 4, 0}, {Vector3d(5, 5, 5), 9, 0.5}};
  ASSERT_OK_AND_ASSIGN(const Tetrahedralization filled, Tetrahedralize(boxes, options));
  ASSERT_THAT(filled.region_of_tet, SizeIs(filled.mesh.num_tets()));
  const Eigen::VectorXd volumes = TetVolumes(filled.mesh.positions(), filled.mesh.tets());
  double inner = 0;
  for (Eigen::Index t = 0; t < volumes.size(); ++t) {
    const bool is_inner = filled.region_of_tet[t] == 9;
    EXPECT_TRUE(is_inner || filled.region_of_tet[t] == 4);
    inner += is_inner ? volumes[t] : 0;
    EXPECT_TRUE(!is_inner || volumes[t] <= 0.5) << volumes[t];
  }
  EXPECT_NEAR(inner, 64, 1e-9);
  EXPECT_NEAR(volumes.sum(), 1000, 1e-9);
}

TEST(TetrahedralizationTest, CavityStaysEmpty) {
  const TriangleMesh outer = BoxSurface({0, 0, 0}, {10, 10, 10}, 4);
  const TriangleMesh wall = InsideOut(SphereSurface({4, 5, 5}, 2, 3));
  const double expected = VolumeInside(outer) + VolumeInside(wall);
  ASSERT_OK_AND_ASSIGN(const Tetrahedralization filled, Tetrahedralize(Together(outer, wall)));
  EXPECT_NEAR(Volume(filled.mesh), expected, 1e-9);
  // The same when all of it faces inwards.
  ASSERT_OK_AND_ASSIGN(const Tetrahedralization turned,
                       Tetrahedralize(InsideOut(Together(outer, wall))));
  EXPECT_NEAR(Volume(turned.mesh), expected, 1e-9);
}

TEST(TetrahedralizationTest, HoleStaysEmpty) {
  const TriangleMesh boxes =
      Together(BoxSurface({0, 0, 0}, {10, 10, 10}, 4), BoxSurface({3, 3, 3}, {7, 7, 7}, 2));
  TetrahedralizationOptions options;
  options.holes_mm = {Vector3d(5, 5, 5)};
  ASSERT_OK_AND_ASSIGN(const Tetrahedralization filled, Tetrahedralize(boxes, options));
  EXPECT_NEAR(Volume(filled.mesh), 936, 1e-9);
}

TEST(TetrahedralizationTest, DefectIsNamedBeforeTetgenIsTried) {
  EXPECT_THAT(Tetrahedralize(WithHole(BoxSurface({0, 0, 0}, {1, 1, 1}))),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("3 edges have only one")));
  const TriangleMesh crossing =
      Together(SphereSurface({0, 0, 0}, 1, 4), SphereSurface({1, 0.1, 0.2}, 1, 4));
  EXPECT_THAT(Tetrahedralize(crossing),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("triangles intersect")));
}

TEST(TetrahedralizationTest, OptionsWithoutSenseAreRefused) {
  const TriangleMesh box = BoxSurface({0, 0, 0}, {1, 1, 1});
  TetrahedralizationOptions ratio;
  ratio.max_radius_edge_ratio = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(Tetrahedralize(box, ratio),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("radius-edge ratio")));
  TetrahedralizationOptions dihedral;
  dihedral.min_dihedral_deg = 40;
  EXPECT_THAT(Tetrahedralize(box, dihedral),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("dihedral")));
  TetrahedralizationOptions lengths;
  lengths.edge_lengths_mm = {1, 2};
  EXPECT_THAT(Tetrahedralize(box, lengths),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("2 edge lengths for 8")));
}

TEST(TetrahedralizationTest, TimeLimitEndsTheChild) {
  TetrahedralizationOptions options;
  options.keep_surface = false;
  options.max_tet_volume_mm3 = 1e-6;
  options.limits.max_seconds = 1;
  EXPECT_THAT(Tetrahedralize(BoxSurface({0, 0, 0}, {10, 10, 10}), options),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("1 seconds")));
}

TEST(TetrahedralizationTest, TongueOfTheDentistryDataIsFilled) {
  const std::string path = testing::SharedDataPath("tet_sofa_tongue/tongue.obj");
  if (path.empty()) GTEST_SKIP() << "the large data sets are not here";
  ASSERT_OK_AND_ASSIGN(const TriangleMeshFile file, ReadTriangleMesh(path));
  ASSERT_OK_AND_ASSIGN(const Tetrahedralization filled, Tetrahedralize(file.mesh));
  EXPECT_TRUE(ValidateTetMesh(filled.mesh).usable());
  EXPECT_NEAR(Volume(filled.mesh), VolumeInside(file.mesh), 1e-6 * VolumeInside(file.mesh));
}

}  // namespace
}  // namespace tissueform
