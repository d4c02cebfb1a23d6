// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/tet_topology.h"

#include <cstdint>
#include <set>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <Eigen/Geometry>

#include "core/mesh/tet_quality.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;

// Volume enclosed by a closed surface by the divergence theorem: independent of the tets.
double EnclosedVolume(const Positions& v, const TriangleIndices& facets) {
  double volume = 0;
  for (Eigen::Index f = 0; f < facets.rows(); ++f) {
    const Eigen::RowVector3d a = v.row(facets(f, 0));
    const Eigen::RowVector3d b = v.row(facets(f, 1));
    const Eigen::RowVector3d c = v.row(facets(f, 2));
    volume += a.dot(b.cross(c)) / 6.0;
  }
  return volume;
}

TEST(BoundaryFacetsTest, OfATetAreItsFourFacets) {
  EXPECT_EQ(BoundaryFacets(testing::SingleTet()).rows(), 4);
}

TEST(BoundaryFacetsTest, PointOutwards) {
  for (const TetMesh& mesh :
       {testing::SingleTet(), testing::Bar({2, 3, 4}, 1.0, 0.2),
        testing::LoadTestMesh("meshes/tet_sofa_tongue/volumetricTongue.vtu")}) {
    const double volume = TetVolumes(mesh.positions(), mesh.tets()).sum();
    EXPECT_GT(volume, 0);
    EXPECT_NEAR(EnclosedVolume(mesh.positions(), BoundaryFacets(mesh)), volume, 1e-12 * volume);
  }
}

TEST(BoundaryFacetsTest, OfABarAreTwoTrianglesForEachOuterSquare) {
  const TetMesh bar = testing::Bar({2, 3, 4});
  EXPECT_EQ(BoundaryFacets(bar).rows(), 2 * 2 * (2 * 3 + 3 * 4 + 2 * 4));
  EXPECT_EQ(BoundaryVertices(bar).size(), static_cast<size_t>(3 * 4 * 5 - 1 * 2 * 3));
}

TEST(BoundaryFacetsTest, OfTheTongueAreThoseItsSourceCounts) {
  EXPECT_EQ(
      BoundaryFacets(testing::LoadTestMesh("meshes/tet_sofa_tongue/volumetricTongue.vtu")).rows(),
      1940);
}

TEST(TetsBehindTest, HaveTheFacetsThatTheyAreBehind) {
  for (const TetMesh& mesh :
       {testing::SingleTet(), testing::Bar({2, 3, 4}),
        testing::LoadTestMesh("meshes/tet_sofa_tongue/volumetricTongue.vtu")}) {
    const TriangleIndices facets = BoundaryFacets(mesh);
    const std::vector<int32_t> tets = TetsBehind(facets, mesh);
    ASSERT_EQ(static_cast<Eigen::Index>(tets.size()), facets.rows());
    for (Eigen::Index f = 0; f < facets.rows(); ++f) {
      const auto corners = mesh.tets().row(tets[f]);
      for (int k = 0; k < 3; ++k) EXPECT_TRUE((corners.array() == facets(f, k)).any());
    }
  }
}

TEST(ConnectedComponentsTest, AreCountedAndUnusedVerticesLeftOut) {
  Positions positions = Positions::Random(10, 3);
  TetIndices tets(2, 4);
  tets << 5, 6, 7, 8, 0, 1, 2, 3;
  ASSERT_OK_AND_ASSIGN(const TetMesh mesh, TetMesh::Create(positions, tets));
  const ConnectedComponents components = FindConnectedComponents(mesh.tets(), 10);
  EXPECT_EQ(components.count, 2);
  EXPECT_THAT(components.component_of_vertex, ElementsAre(0, 0, 0, 0, -1, 1, 1, 1, 1, -1));
}

TEST(VertexCellsTest, ListEveryCornerOfEveryTetOnce) {
  const TetMesh bar = testing::Bar({2, 2, 2});
  const VertexCells vertex_cells(bar.tets(), bar.num_vertices());
  std::set<std::pair<int32_t, int>> seen;
  for (int32_t v = 0; v < bar.num_vertices(); ++v) {
    for (Eigen::Index k = vertex_cells.begin(v); k < vertex_cells.end(v); ++k) {
      EXPECT_EQ(bar.tets()(vertex_cells.cell(k), vertex_cells.corner(k)), v);
      seen.emplace(vertex_cells.cell(k), vertex_cells.corner(k));
    }
  }
  EXPECT_EQ(seen.size(), static_cast<size_t>(bar.tets().size()));
}

}  // namespace
}  // namespace tissueform
