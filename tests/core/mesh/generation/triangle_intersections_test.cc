// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/generation/triangle_intersections.h"

#include <random>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "tests/core/mesh/generation/surfaces.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using tissueform::testing::BoxSurface;
using tissueform::testing::SphereSurface;
using tissueform::testing::Together;
using Pair = std::array<int32_t, 2>;

TriangleMesh Triangles(const Positions& positions, const TriangleIndices& triangles) {
  return *TriangleMesh::Create(positions, triangles);
}

// `count` triangles without common vertices.
TriangleMesh RandomTriangles(int count, uint32_t seed) {
  std::mt19937 generator(seed);
  Positions positions(3 * count, 3);
  for (double& c : positions.reshaped()) c = generator() / 4294967295.0;
  TriangleIndices triangles(count, 3);
  for (int32_t k = 0; k < 3 * count; ++k) triangles(k / 3, k % 3) = k;
  return Triangles(positions, triangles);
}

// Whether the segment pq crosses the triangle: by solving for the point, in general position.
bool Crosses(const Vector3d& p, const Vector3d& q, const std::array<Vector3d, 3>& t) {
  Eigen::Matrix3d system;
  system << t[1] - t[0], t[2] - t[0], p - q;
  const Vector3d x = system.inverse() * (p - t[0]);
  return x[0] > 0 && x[1] > 0 && x[0] + x[1] < 1 && x[2] > 0 && x[2] < 1;
}

std::vector<Pair> CrossingPairs(const TriangleMesh& mesh) {
  const auto corners = [&](int32_t f) {
    std::array<Vector3d, 3> t;
    for (int k = 0; k < 3; ++k) t[k] = mesh.positions().row(mesh.triangles()(f, k)).transpose();
    return t;
  };
  std::vector<Pair> pairs;
  for (int32_t f = 0; f < mesh.num_triangles(); ++f) {
    for (int32_t g = f + 1; g < mesh.num_triangles(); ++g) {
      const auto a = corners(f);
      const auto b = corners(g);
      bool cross = false;
      for (int k = 0; k < 3; ++k) {
        cross |= Crosses(a[k], a[(k + 1) % 3], b) || Crosses(b[k], b[(k + 1) % 3], a);
      }
      if (cross) pairs.push_back({f, g});
    }
  }
  return pairs;
}

TEST(TriangleIntersectionsTest, RandomTrianglesCrossWhereTheirEdgesDo) {
  for (uint32_t seed = 1; seed <= 5; ++seed) {
    const TriangleMesh mesh = RandomTriangles(60, seed);
    const std::vector<Pair> expected = CrossingPairs(mesh);
    EXPECT_GT(expected.size(), 20U);
    EXPECT_EQ(FindTriangleIntersections(mesh).pairs, expected);
  }
}

TEST(TriangleIntersectionsTest, NeighboursOfAClosedSurfaceDoNotIntersect) {
  EXPECT_THAT(FindTriangleIntersections(BoxSurface({0, 0, 0}, {1, 2, 3}, 5)).pairs, IsEmpty());
  EXPECT_THAT(FindTriangleIntersections(SphereSurface({1, 2, 3}, 7, 10)).pairs, IsEmpty());
}

TEST(TriangleIntersectionsTest, VerticesAtOnePlaceCountAsShared) {
  // The triangles of a box, each with corners of its own.
  const TriangleMesh box = BoxSurface({0, 0, 0}, {1, 1, 1}, 2);
  Positions positions(3 * box.num_triangles(), 3);
  TriangleIndices triangles(box.num_triangles(), 3);
  for (int32_t k = 0; k < positions.rows(); ++k) {
    positions.row(k) = box.positions().row(box.triangles()(k / 3, k % 3));
    triangles(k / 3, k % 3) = k;
  }
  EXPECT_THAT(FindTriangleIntersections(Triangles(positions, triangles)).pairs, IsEmpty());
}

TEST(TriangleIntersectionsTest, TriangleFoldedOntoItsNeighbourIntersects) {
  Positions positions(4, 3);
  positions << 0, 0, 0, 2, 0, 0, 0, 2, 0, 1, 1.5, 0;
  TriangleIndices triangles(2, 3);
  triangles << 0, 1, 2, 1, 0, 3;
  EXPECT_THAT(FindTriangleIntersections(Triangles(positions, triangles)).pairs,
              ElementsAre(Pair{0, 1}));
  positions(3, 1) = -1.5;  // unfolded
  EXPECT_THAT(FindTriangleIntersections(Triangles(positions, triangles)).pairs, IsEmpty());
}

TEST(TriangleIntersectionsTest, TriangleThatPiercesItsNeighbourAtAVertexIntersects) {
  Positions positions(5, 3);
  positions << 0, 0, 0, 2, 0, 0, 0, 2, 0, 1, 1, 1, 0.5, 0.5, -1;
  TriangleIndices triangles(2, 3);
  triangles << 0, 1, 2, 0, 3, 4;
  EXPECT_THAT(FindTriangleIntersections(Triangles(positions, triangles)).pairs,
              ElementsAre(Pair{0, 1}));
  positions(4, 2) = 0.25;  // above the first
  EXPECT_THAT(FindTriangleIntersections(Triangles(positions, triangles)).pairs, IsEmpty());
}

TEST(TriangleIntersectionsTest, EveryPairOfOverlappingSpheresIsOneOfEach) {
  const TriangleMesh a = SphereSurface({0, 0, 0}, 1, 6);
  const TriangleMesh b = SphereSurface({1.1, 0.07, 0.03}, 1, 6);
  const TriangleIntersections found = FindTriangleIntersections(Together(a, b));
  EXPECT_GT(found.pairs.size(), 50U);
  for (const Pair& pair : found.pairs) {
    EXPECT_LT(pair[0], a.num_triangles());
    EXPECT_GE(pair[1], a.num_triangles());
  }
}

TEST(TriangleIntersectionsTest, SearchEndsAtTheMostPairs) {
  const TriangleMesh mesh = RandomTriangles(60, 1);
  const TriangleIntersections found = FindTriangleIntersections(mesh, 7);
  EXPECT_FALSE(found.complete);
  EXPECT_THAT(found.pairs, SizeIs(7));
  EXPECT_TRUE(FindTriangleIntersections(mesh).complete);
}

}  // namespace
}  // namespace tissueform
