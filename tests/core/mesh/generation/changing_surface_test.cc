// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/generation/changing_surface.h"

#include <random>

#include "core/mesh/half_edges.h"
#include "core/mesh/surface_validation.h"
#include "tests/core/mesh/generation/surfaces.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using tissueform::testing::BoxSurface;
using tissueform::testing::SphereSurface;
using tissueform::testing::VolumeInside;

// Closed, manifold, one component, one side outside, without handles.
void ExpectOneBall(const TriangleMesh& mesh) {
  int edges = 0;
  ForEachEdge(mesh.triangles(), [&edges](EdgeUses uses) {
    ++edges;
    EXPECT_EQ(uses.size(), 2);
    EXPECT_FALSE(IsTurned(uses));
  });
  EXPECT_EQ(mesh.num_vertices() - edges + mesh.num_triangles(), 2);
  EXPECT_EQ(ValidateTriangleMesh(mesh).num_components, 1);
}

TEST(ChangingSurfaceTest, UnchangedItIsTheSameMesh) {
  const TriangleMesh box = BoxSurface({0, 0, 0}, {4, 5, 6}, 3);
  const TriangleMesh same = ChangingSurface(box, 0).Compact();
  EXPECT_EQ(same.positions(), box.positions());
  EXPECT_EQ(same.triangles(), box.triangles());
}

TEST(ChangingSurfaceTest, SplitKeepsTheShapeAndHalvesTheEdge) {
  ChangingSurface surface(BoxSurface({0, 0, 0}, {2, 2, 2}), 60);
  const bool was_feature = surface.IsFeature(0);
  const double square = surface.SquaredLength(0);
  const int32_t middle = surface.Split(0);
  EXPECT_EQ(surface.Valence(middle), 4);
  EXPECT_EQ(surface.NumFeatures(middle), was_feature ? 2 : 0);
  EXPECT_DOUBLE_EQ(surface.SquaredLength(0), square / 4);
  ExpectOneBall(surface.Compact());
  EXPECT_NEAR(VolumeInside(surface.Compact()), 8, 1e-12);
}

TEST(ChangingSurfaceTest, FlipTurnsTheDiagonalAndTwiceIsNoChange) {
  ChangingSurface surface(SphereSurface({0, 0, 0}, 3, 4), 0);
  int32_t h = 0;
  while (!surface.CanFlip(h)) ++h;
  const int32_t a = surface.From(h);
  const int32_t b = surface.To(h);
  const int32_t c = surface.Opposite(h);
  const int32_t d = surface.Opposite(surface.Twin(h));
  surface.Flip(h);
  EXPECT_FALSE(surface.AreNeighbours(a, b));
  EXPECT_TRUE(surface.AreNeighbours(c, d));
  ExpectOneBall(surface.Compact());
  surface.Flip(h);
  EXPECT_TRUE(surface.AreNeighbours(a, b));
  EXPECT_FALSE(surface.AreNeighbours(c, d));
  ExpectOneBall(surface.Compact());
}

TEST(ChangingSurfaceTest, FeaturesAreTheEdgesOfABoxAndAreNotFlipped) {
  const ChangingSurface surface(BoxSurface({0, 0, 0}, {1, 1, 1}, 2), 60);
  int features = 0;
  for (int32_t h = 0; h < surface.num_half_edges(); ++h) {
    if (!surface.IsFeature(h)) continue;
    ++features;
    EXPECT_FALSE(surface.CanFlip(h));
  }
  EXPECT_EQ(features, 2 * 12 * 2);  // half-edges of twelve edges in two parts
}

TEST(ChangingSurfaceTest, ATetrahedronIsNotCollapsed) {
  Positions positions(4, 3);
  positions << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1;
  TriangleIndices triangles(4, 3);
  triangles << 0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3;
  ASSERT_OK_AND_ASSIGN(const TriangleMesh tetrahedron, TriangleMesh::Create(positions, triangles));
  const ChangingSurface surface(tetrahedron, 0);
  for (int32_t h = 0; h < surface.num_half_edges(); ++h) {
    EXPECT_FALSE(surface.CanCollapse(h));
    EXPECT_FALSE(surface.CanFlip(h));
  }
}

TEST(ChangingSurfaceTest, PartsThatTouchAtAVertexGetOneEach) {
  // Two tetrahedra with vertex 0 in common.
  Positions positions(7, 3);
  positions << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, -1, 0, 0, 0, 0, -1, 0, -1, 0;
  TriangleIndices triangles(8, 3);
  triangles << 0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3, 0, 5, 4, 0, 4, 6, 4, 5, 6, 5, 0, 6;
  ASSERT_OK_AND_ASSIGN(const TriangleMesh touching, TriangleMesh::Create(positions, triangles));
  const TriangleMesh apart = ChangingSurface(touching, 0).Compact();
  EXPECT_EQ(apart.num_vertices(), 8);
  EXPECT_EQ(ValidateTriangleMesh(apart).num_components, 2);
}

TEST(ChangingSurfaceTest, AThousandRandomChangesLeaveABall) {
  ChangingSurface surface(SphereSurface({0, 0, 0}, 3, 5), 0);
  std::mt19937 generator(11);
  int collapses = 0;
  int flips = 0;
  for (int step = 0; step < 1000; ++step) {
    const auto h = static_cast<int32_t>(generator() % surface.num_half_edges());
    if (!surface.HasHalfEdge(h)) continue;
    switch (generator() % 3) {
      case 0:
        surface.Split(h);
        break;
      case 1:
        if (surface.CanCollapse(h)) {
          surface.Collapse(h);
          ++collapses;
        }
        break;
      default:
        if (surface.CanFlip(h)) {
          surface.Flip(h);
          ++flips;
        }
    }
    if (step % 100 == 99) ExpectOneBall(surface.Compact());
  }
  EXPECT_GT(collapses, 50);
  EXPECT_GT(flips, 50);
}

}  // namespace
}  // namespace tissueform
