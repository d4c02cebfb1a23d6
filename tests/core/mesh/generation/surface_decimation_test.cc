// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/generation/surface_decimation.h"

#include <algorithm>

#include "gtest/gtest.h"

#include "core/mesh/generation/surface_distance.h"
#include "core/mesh/surface_validation.h"
#include "core/mesh/tet_topology.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

// The boundary of a cube of so many cells, on a ball of 50 mm where `round`.
TriangleMesh CubeSurface(int cells, bool round) {
  const TetMesh cube = testing::Bar({cells, cells, cells}, 100.0 / cells);
  Positions positions = cube.positions().array() - 50;
  if (round) {
    for (auto row : positions.rowwise()) row *= 50 / std::max(row.norm(), 1.0);
  }
  return *TriangleMesh::Create(positions, BoundaryFacets(cube));
}

TEST(DecimateSurfaceTest, ABallStaysAClosedBallOfTheWantedSize) {
  const TriangleMesh ball = CubeSurface(24, true);
  ASSERT_OK_AND_ASSIGN(const TriangleMesh coarse, DecimateSurface(ball, 1000));
  EXPECT_NEAR(static_cast<double>(coarse.num_triangles()), 1000, 10);
  const SurfaceReport report = ValidateTriangleMesh(coarse);
  EXPECT_TRUE(report.is_closed());
  EXPECT_EQ(report.euler_characteristic, 2);
  EXPECT_NEAR(report.enclosed_volume_mm3, ValidateTriangleMesh(ball).enclosed_volume_mm3,
              0.002 * report.enclosed_volume_mm3);
  EXPECT_LT(DistancesToSurface(coarse.positions(), ball).maxCoeff(), 0.6);
}

TEST(DecimateSurfaceTest, EdgesOfACubeStaySharp) {
  ASSERT_OK_AND_ASSIGN(const TriangleMesh coarse, DecimateSurface(CubeSurface(16, false), 60));
  const SurfaceReport report = ValidateTriangleMesh(coarse);
  EXPECT_TRUE(report.is_closed());
  EXPECT_NEAR(report.enclosed_volume_mm3, 1e6, 1);
  EXPECT_NEAR(report.area_mm2, 6e4, 1);
}

TEST(DecimateSurfaceTest, KeepsASurfaceWithFewTriangles) {
  const TriangleMesh cube = CubeSurface(2, false);
  ASSERT_OK_AND_ASSIGN(const TriangleMesh same, DecimateSurface(cube, 1000));
  EXPECT_EQ(same.triangles(), cube.triangles());
}

TEST(DecimateSurfaceTest, TheSameSurfaceGivesTheSameTriangles) {
  const TriangleMesh ball = CubeSurface(12, true);
  ASSERT_OK_AND_ASSIGN(const TriangleMesh once, DecimateSurface(ball, 300));
  ASSERT_OK_AND_ASSIGN(const TriangleMesh again, DecimateSurface(ball, 300));
  EXPECT_EQ(once.positions(), again.positions());
  EXPECT_EQ(once.triangles(), again.triangles());
}

TEST(DecimateSurfaceTest, WallsThatTouchInAnEdgeAreTakenApart) {
  // Two cubes that share one edge.
  const TriangleMesh cube = CubeSurface(4, false);
  Positions positions(2 * cube.num_vertices(), 3);
  positions << cube.positions(), cube.positions().rowwise() + Eigen::RowVector3d(100, 100, 0);
  TriangleIndices triangles(2 * cube.num_triangles(), 3);
  triangles << cube.triangles(),
      cube.triangles().array() + static_cast<int32_t>(cube.num_vertices());
  // The second's vertices where the first has some.
  for (int32_t& v : triangles.reshaped()) {
    for (Eigen::Index first = 0; first < cube.num_vertices(); ++first) {
      if (positions.row(first) == positions.row(v)) v = static_cast<int32_t>(first);
    }
  }
  const TriangleMesh touching = *TriangleMesh::Create(positions, triangles);
  ASSERT_OK_AND_ASSIGN(const TriangleMesh coarse, DecimateSurface(touching, 100));
  EXPECT_NEAR(ValidateTriangleMesh(coarse).area_mm2, 1.2e5, 1);
}

}  // namespace
}  // namespace tissueform
