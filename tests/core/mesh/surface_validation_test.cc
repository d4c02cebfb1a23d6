// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/surface_validation.h"

#include <limits>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mesh/io/triangle_mesh_io.h"
#include "core/mesh/tet_topology.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;

// The boundary of a grid of 2 x 2 x 2 cubes of 1 mm; the vertex in the middle is inside.
TriangleMesh Box() {
  const TetMesh bar = testing::Bar({2, 2, 2});
  return *TriangleMesh::Create(bar.positions(), BoundaryFacets(bar));
}

SurfaceReport Validate(const TriangleIndices& triangles) {
  return ValidateTriangleMesh(*TriangleMesh::Create(Box().positions(), triangles));
}

TEST(SurfaceValidationTest, BoxIsClosedWithItsAreaAndVolume) {
  const SurfaceReport report = ValidateTriangleMesh(Box());
  EXPECT_TRUE(report.usable());
  EXPECT_TRUE(report.is_closed());
  EXPECT_EQ(report.euler_characteristic, 2);
  EXPECT_EQ(report.num_components, 1);
  EXPECT_NEAR(report.area_mm2, 24, 1e-12);
  EXPECT_NEAR(report.enclosed_volume_mm3, 8, 1e-12);
  ASSERT_NE(report.Find("unreferenced_vertices"), nullptr);
  EXPECT_THAT(report.Find("unreferenced_vertices")->examples, ElementsAre(13));
}

TEST(SurfaceValidationTest, SurfaceThatFacesInwardsHasNegativeVolume) {
  TriangleIndices triangles = Box().triangles();
  triangles.col(0).swap(triangles.col(1));
  EXPECT_NEAR(Validate(triangles).enclosed_volume_mm3, -8, 1e-12);
}

TEST(SurfaceValidationTest, MissingTriangleLeavesThreeOpenEdges) {
  const TriangleIndices triangles = Box().triangles();
  const SurfaceReport report = Validate(triangles.topRows(triangles.rows() - 1));
  ASSERT_NE(report.Find("open_edges"), nullptr);
  EXPECT_EQ(report.Find("open_edges")->count, 3);
  EXPECT_FALSE(report.is_closed());
  EXPECT_TRUE(report.usable());
  EXPECT_EQ(report.enclosed_volume_mm3, 0);
}

TEST(SurfaceValidationTest, RepeatedTriangleMakesThreeNonManifoldEdges) {
  TriangleIndices triangles = Box().triangles();
  triangles.conservativeResize(triangles.rows() + 1, 3);
  triangles.bottomRows(1) = triangles.topRows(1).eval();
  const SurfaceReport report = Validate(triangles);
  ASSERT_NE(report.Find("non_manifold_edges"), nullptr);
  EXPECT_EQ(report.Find("non_manifold_edges")->count, 3);
  EXPECT_FALSE(report.is_closed());
}

TEST(SurfaceValidationTest, TurnedTriangleIsFoundAtItsThreeEdges) {
  TriangleIndices triangles = Box().triangles();
  std::swap(triangles(4, 0), triangles(4, 1));
  const SurfaceReport report = Validate(triangles);
  ASSERT_NE(report.Find("turned_triangles"), nullptr);
  EXPECT_EQ(report.Find("turned_triangles")->count, 3);
  EXPECT_FALSE(report.is_closed());
}

TEST(SurfaceValidationTest, TriangleWithoutAreaMakesTheSurfaceUnusable) {
  TriangleIndices triangles = Box().triangles();
  triangles(4, 0) = triangles(4, 1);
  const SurfaceReport report = Validate(triangles);
  ASSERT_NE(report.Find("degenerate_triangles"), nullptr);
  EXPECT_THAT(report.Find("degenerate_triangles")->examples, ElementsAre(4));
  EXPECT_FALSE(report.usable());
}

TEST(SurfaceValidationTest, NonFiniteVertexMakesTheSurfaceUnusable) {
  Positions positions = Box().positions();
  positions(3, 1) = std::numeric_limits<double>::quiet_NaN();
  const SurfaceReport report =
      ValidateTriangleMesh(*TriangleMesh::Create(positions, Box().triangles()));
  ASSERT_NE(report.Find("non_finite_vertices"), nullptr);
  EXPECT_THAT(report.Find("non_finite_vertices")->examples, ElementsAre(3));
  EXPECT_FALSE(report.usable());
}

TEST(SurfaceValidationTest, VertexAtTheSamePlaceIsAWarning) {
  Positions positions = Box().positions();
  positions.row(13) = positions.row(2);
  const SurfaceReport report =
      ValidateTriangleMesh(*TriangleMesh::Create(positions, Box().triangles()));
  ASSERT_NE(report.Find("duplicate_vertices"), nullptr);
  EXPECT_THAT(report.Find("duplicate_vertices")->examples, ElementsAre(13));
  EXPECT_TRUE(report.usable());
}

struct PublicSurface {
  const char* path;
  Eigen::Index vertices;
  Eigen::Index open_edges;
  Eigen::Index non_manifold_edges;
  int32_t components;
};

// Figures from the SOURCE.md beside each, found with other programs.
TEST(SurfaceValidationTest, PublicSurfacesHaveTheirPublishedDefects) {
  const auto count = [](const SurfaceReport& report, std::string_view kind) {
    return report.Find(kind) == nullptr ? Eigen::Index{0} : report.Find(kind)->count;
  };
  int read = 0;
  for (const PublicSurface& surface :
       {PublicSurface{"surf_manifold_tests/boxNotManifold.obj", 9, 4, 0, 1},
        PublicSurface{"surf_sofa_dentistry/skull_and_teeth_coarse.obj", 4775, 3, 3, 34},
        PublicSurface{"surf_sofa_dentistry/head.obj", 3931, 40, 0, 1},
        PublicSurface{"surf_sofa_dentistry/teeth.obj", 5325, 175, 0, 13},
        PublicSurface{"surf_sofa_dentistry/tooth_coarse_mesh.obj", 1588, 157, 0, 1},
        PublicSurface{"surf_sofa_liver_smooth/liver-smooth.obj", 2194, 0, 0, 1},
        PublicSurface{"tet_sofa_tongue/tongue.obj", 2544, 0, 0, 1}}) {
    const std::string path = testing::SharedDataPath(surface.path);
    if (path.empty()) continue;
    ++read;
    ASSERT_OK_AND_ASSIGN(const TriangleMeshFile file, ReadTriangleMesh(path));
    const SurfaceReport report = ValidateTriangleMesh(file.mesh, file.split_polygons);
    EXPECT_EQ(report.num_vertices, surface.vertices) << surface.path;
    EXPECT_EQ(count(report, "open_edges"), surface.open_edges) << surface.path;
    EXPECT_EQ(count(report, "non_manifold_edges"), surface.non_manifold_edges) << surface.path;
    EXPECT_EQ(report.num_components, surface.components) << surface.path;
  }
  if (read == 0) GTEST_SKIP() << "the large data sets are not here";
}

TEST(SurfaceValidationTest, BundledOpenBoxHasItsPublishedOpenEdges) {
  ASSERT_OK_AND_ASSIGN(
      const TriangleMeshFile file,
      ReadTriangleMesh(testing::TestDataPath("meshes/surf_manifold_tests/boxNotManifold.obj")));
  const SurfaceReport report = ValidateTriangleMesh(file.mesh);
  ASSERT_NE(report.Find("open_edges"), nullptr);
  EXPECT_EQ(report.Find("open_edges")->count, 4);
  EXPECT_FALSE(report.is_closed());
}

}  // namespace
}  // namespace tissueform
