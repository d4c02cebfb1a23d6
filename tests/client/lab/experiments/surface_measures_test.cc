// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/experiments/surface_measures.h"

#include "client/lab/accuracy/boundary_surface.h"
#include "core/mesh/bar_mesh.h"
#include "core/mesh/tet_topology.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

TriangleMesh BarSurface() { return BoundaryOf(BarMesh(CubeGrid({3, 4, 5}, 0.5)).value()).mesh; }

// Two copies of one surface, the second one moved.
TriangleMesh Twice(const TriangleMesh& mesh, const Eigen::RowVector3d& offset) {
  Positions positions(2 * mesh.num_vertices(), 3);
  positions << mesh.positions(), mesh.positions().rowwise() + offset;
  TriangleIndices triangles(2 * mesh.num_triangles(), 3);
  triangles << mesh.triangles(),
      mesh.triangles().array() + static_cast<int32_t>(mesh.num_vertices());
  return TriangleMesh::Create(std::move(positions), std::move(triangles)).value();
}

TEST(SurfaceMeasuresTest, VolumeOfABoxIsExactWhereverItLies) {
  const TriangleMesh bar = BarSurface();
  EXPECT_NEAR(EnclosedVolume(bar.positions(), bar.triangles()), 1.5 * 2 * 2.5, 1e-12);
  const Positions moved = bar.positions().rowwise() + Eigen::RowVector3d(10, -20, 30);
  EXPECT_NEAR(EnclosedVolume(moved, bar.triangles()), 1.5 * 2 * 2.5, 1e-10);
}

TEST(SurfaceMeasuresTest, SectionsOfABoxAreExactBetweenAndInPlanesOfVertices) {
  const TriangleMesh bar = BarSurface();
  for (const double area : SectionAreas(bar.positions(), bar.triangles(), {0.1, 0.5, 1.23, 2.0})) {
    EXPECT_NEAR(area, 1.5 * 2, 1e-12);
  }
}

TEST(SurfaceMeasuresTest, SectionOutsideIsEmpty) {
  const TriangleMesh bar = BarSurface();
  EXPECT_EQ(SectionAreas(bar.positions(), bar.triangles(), {-1, 3}), (std::vector<double>{0, 0}));
}

TEST(SurfaceMeasuresTest, SectionOfAShearedBoxKeepsItsArea) {
  const TriangleMesh bar = BarSurface();
  Positions sheared = bar.positions();
  sheared.col(0) += 0.7 * sheared.col(2);
  EXPECT_NEAR(SectionAreas(sheared, bar.triangles(), {1.1})[0], 1.5 * 2, 1e-12);
}

TEST(SurfaceMeasuresTest, BoxDoesNotIntersectItself) {
  const TriangleMesh bar = BarSurface();
  EXPECT_EQ(CountSelfIntersections(bar.positions(), bar.triangles()), 0);
}

TEST(SurfaceMeasuresTest, BoxesApartDoNotIntersectAndOverlappingOnesDo) {
  const TriangleMesh apart = Twice(BarSurface(), {5, 0, 0});
  EXPECT_EQ(CountSelfIntersections(apart.positions(), apart.triangles()), 0);
  const TriangleMesh overlapping = Twice(BarSurface(), {0.61, 0.52, 0.73});
  EXPECT_GT(CountSelfIntersections(overlapping.positions(), overlapping.triangles()), 10);
}

TEST(SurfaceMeasuresTest, TwoCrossingTrianglesAreOnePair) {
  Positions positions(6, 3);
  positions << 0, 0, 0, 2, 0, 0, 0, 2, 0, 0.5, 0.5, -1, 0.5, 0.5, 1, 0.6, 0.4, 1;
  TriangleIndices triangles(2, 3);
  triangles << 0, 1, 2, 3, 4, 5;
  EXPECT_EQ(CountSelfIntersections(positions, triangles), 1);
  positions.bottomRows(3).col(2).array() += 3;
  EXPECT_EQ(CountSelfIntersections(positions, triangles), 0);
}

TEST(BoundarySurfaceTest, VerticesAndTrianglesAreThoseOfTheTetMesh) {
  ASSERT_OK_AND_ASSIGN(const TetMesh bar, BarMesh(CubeGrid({3, 3, 3}, 1)));
  const BoundarySurface boundary = BoundaryOf(bar);
  EXPECT_EQ(boundary.mesh.num_vertices(), 4 * 4 * 4 - 2 * 2 * 2);
  EXPECT_EQ(boundary.Pick(bar.positions()), boundary.mesh.positions());
  const TriangleIndices facets = BoundaryFacets(bar);
  for (Eigen::Index f = 0; f < facets.rows(); ++f) {
    for (int corner = 0; corner < 3; ++corner) {
      EXPECT_EQ(boundary.vertices[static_cast<size_t>(boundary.mesh.triangles()(f, corner))],
                facets(f, corner));
    }
  }
}

}  // namespace
}  // namespace tissueform
