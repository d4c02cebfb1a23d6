// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/generation/surface_remeshing.h"

#include <cmath>

#include "core/mesh/generation/surface_defects.h"
#include "core/mesh/half_edges.h"
#include "tests/core/mesh/generation/surfaces.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using tissueform::testing::BoxSurface;
using tissueform::testing::InsideOut;
using tissueform::testing::IsOk;
using tissueform::testing::SphereSurface;
using tissueform::testing::StatusIs;
using tissueform::testing::Together;
using tissueform::testing::VolumeInside;
using tissueform::testing::WithHole;

// Mean length of the edges whose middle lies beyond `from_x`.
double MeanEdge(const TriangleMesh& mesh, double from_x = -1e9) {
  double sum = 0;
  int count = 0;
  ForEachEdge(mesh.triangles(), [&](EdgeUses uses) {
    const Eigen::RowVector3d a = mesh.positions().row(uses[0].edge[0]);
    const Eigen::RowVector3d b = mesh.positions().row(uses[0].edge[1]);
    if (0.5 * (a.x() + b.x()) < from_x) return;
    sum += (a - b).norm();
    ++count;
  });
  return sum / count;
}

RemeshingOptions EdgesOf(double edge_mm) {
  RemeshingOptions options;
  options.edge_mm = edge_mm;
  return options;
}

TEST(SurfaceRemeshingTest, SphereGetsEdgesOfTheWantedLengthOnTheOldSurface) {
  const TriangleMesh sphere = SphereSurface({1, 2, 3}, 20, 24);
  ASSERT_OK_AND_ASSIGN(const RemeshedSurface remeshed, RemeshSurface(sphere, EdgesOf(4)));
  EXPECT_THAT(CheckMeshable(FindSurfaceDefects(remeshed.mesh)), IsOk());
  EXPECT_THAT(remeshed.repaired_pairs, IsEmpty());
  EXPECT_NEAR(MeanEdge(remeshed.mesh), 4, 0.4);
  // Halfway between the vertices of the old sphere it lies this much deeper.
  const double sag = 20 - std::sqrt(20 * 20 - 1.7 * 1.7);
  for (const auto& p : remeshed.mesh.positions().rowwise()) {
    const double radius = (p - Eigen::RowVector3d(1, 2, 3)).norm();
    EXPECT_LE(radius, 20 + 1e-9);
    EXPECT_GE(radius, 20 - sag);
  }
}

TEST(SurfaceRemeshingTest, SameSurfaceGivesTheSameTrianglesOnAnyNumberOfThreads) {
  const TriangleMesh sphere = SphereSurface({0, 0, 0}, 20, 24);
  ASSERT_OK_AND_ASSIGN(const RemeshedSurface first, RemeshSurface(sphere, EdgesOf(4)));
  for (const int threads : {1, 2, 3}) {
    RemeshingOptions options = EdgesOf(4);
    options.threads = threads;
    ASSERT_OK_AND_ASSIGN(const RemeshedSurface again, RemeshSurface(sphere, options));
    EXPECT_EQ(first.mesh.positions(), again.mesh.positions());
    EXPECT_EQ(first.mesh.triangles(), again.mesh.triangles());
  }
}

TEST(SurfaceRemeshingTest, ThinPartsAreNotEatenFromTheirTips) {
  // A third of an edge thick.
  const TriangleMesh plate = BoxSurface({0, 0, 0}, {12, 1, 12}, 24);
  ASSERT_OK_AND_ASSIGN(const RemeshedSurface remeshed, RemeshSurface(plate, EdgesOf(3)));
  const Eigen::RowVector3d highest = remeshed.mesh.positions().colwise().maxCoeff();
  EXPECT_GT(highest.x(), 11.5);
  EXPECT_GT(highest.z(), 11.5);
}

TEST(SurfaceRemeshingTest, EdgesAreShorterInAFineRegion) {
  RemeshingOptions options = EdgesOf(5);
  options.fine_regions = {{Vector3d(20, 0, 0), 8, 2}};
  ASSERT_OK_AND_ASSIGN(const RemeshedSurface remeshed,
                       RemeshSurface(SphereSurface({0, 0, 0}, 20, 24), options));
  EXPECT_NEAR(MeanEdge(remeshed.mesh, 19), 2, 0.4);
  ASSERT_OK_AND_ASSIGN(const RemeshedSurface even,
                       RemeshSurface(SphereSurface({0, 0, 0}, 20, 24), EdgesOf(5)));
  EXPECT_NEAR(MeanEdge(even.mesh, 19), 5, 0.8);
  EXPECT_THAT(CheckMeshable(FindSurfaceDefects(remeshed.mesh)), IsOk());
}

TEST(SurfaceRemeshingTest, ThinShellIsRepairedByShorterEdges) {
  // Chords of the outer sphere with edges of 4 mm reach through the inner one.
  const TriangleMesh shell =
      Together(SphereSurface({0, 0, 0}, 10, 16), InsideOut(SphereSurface({0, 0, 0}, 9.85, 16)));
  ASSERT_OK_AND_ASSIGN(const RemeshedSurface remeshed, RemeshSurface(shell, EdgesOf(4)));
  EXPECT_THAT(remeshed.repaired_pairs, Not(IsEmpty()));
  const SurfaceDefects defects = FindSurfaceDefects(remeshed.mesh);
  EXPECT_THAT(CheckMeshable(defects), IsOk());
  EXPECT_EQ(defects.report.num_components, 2);
  EXPECT_LT(MeanEdge(remeshed.mesh), 3.5);
}

TEST(SurfaceRemeshingTest, IntersectionsOfTheOldSurfaceRemainAndAreRefused) {
  const TriangleMesh crossing =
      Together(SphereSurface({0, 0, 0}, 5, 6), SphereSurface({6, 1, 0.5}, 5, 6));
  RemeshingOptions options = EdgesOf(2.5);
  options.max_repairs = 1;
  EXPECT_THAT(RemeshSurface(crossing, options),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("after 1 repairs")));
}

TEST(SurfaceRemeshingTest, FeatureEdgesOfABoxStay) {
  const TriangleMesh box = BoxSurface({0, 0, 0}, {20, 20, 20}, 10);
  RemeshingOptions options = EdgesOf(4);
  options.feature_angle_deg = 60;
  ASSERT_OK_AND_ASSIGN(const RemeshedSurface sharp, RemeshSurface(box, options));
  EXPECT_NEAR(VolumeInside(sharp.mesh), 8000, 1e-6);
  ASSERT_OK_AND_ASSIGN(const RemeshedSurface blunt, RemeshSurface(box, EdgesOf(4)));
  EXPECT_LT(VolumeInside(blunt.mesh), 7990);
}

TEST(SurfaceRemeshingTest, OpenSurfaceIsRefusedByName) {
  EXPECT_THAT(RemeshSurface(WithHole(BoxSurface({0, 0, 0}, {9, 9, 9}, 3)), EdgesOf(2)),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("3 edges have only one")));
}

TEST(SurfaceRemeshingTest, LengthsThatAreNotAboveZeroAreRefused) {
  const TriangleMesh box = BoxSurface({0, 0, 0}, {9, 9, 9}, 3);
  EXPECT_THAT(RemeshSurface(box, EdgesOf(0)),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("edge length 0 mm")));
  RemeshingOptions options = EdgesOf(2);
  options.fine_regions = {{Vector3d::Zero(), 3, -1}};
  EXPECT_THAT(RemeshSurface(box, options),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("fine region")));
}

}  // namespace
}  // namespace tissueform
