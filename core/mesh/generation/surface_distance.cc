// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/generation/surface_distance.h"

#include <cmath>
#include <vector>

#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Simple_cartesian.h>

#include "core/base/parallel_for.h"

namespace tissueform {
namespace {

using Kernel = CGAL::Simple_cartesian<double>;
using Triangles = std::vector<Kernel::Triangle_3>;
using Primitive = CGAL::AABB_triangle_primitive<Kernel, Triangles::const_iterator>;
using Tree = CGAL::AABB_tree<CGAL::AABB_traits<Kernel, Primitive>>;

constexpr Eigen::Index kGrain = 512;

Kernel::Point_3 PointOf(const Positions& positions, Eigen::Index row) {
  return {positions(row, 0), positions(row, 1), positions(row, 2)};
}

Triangles TrianglesOf(const TriangleMesh& surface) {
  Triangles triangles;
  for (const auto& t : surface.triangles().rowwise()) {
    triangles.emplace_back(PointOf(surface.positions(), t[0]), PointOf(surface.positions(), t[1]),
                           PointOf(surface.positions(), t[2]));
  }
  return triangles;
}

Eigen::RowVector3d NormalOf(const Kernel::Triangle_3& triangle) {
  const Kernel::Vector_3 normal =
      CGAL::cross_product(triangle[1] - triangle[0], triangle[2] - triangle[0]);
  return Eigen::RowVector3d(normal.x(), normal.y(), normal.z()).normalized();
}

}  // namespace

Eigen::VectorXd DistancesToSurface(const Positions& points, const TriangleMesh& surface,
                                   int threads) {
  const Triangles triangles = TrianglesOf(surface);
  Tree tree(triangles.begin(), triangles.end());
  tree.accelerate_distance_queries();
  Eigen::VectorXd distances(points.rows());
  if (points.rows() == 0) return distances;
  // What the tree makes when it is first asked is made before threads ask it.
  tree.squared_distance(PointOf(points, 0));
  ParallelFor(threads, points.rows(), kGrain, [&](Eigen::Index begin, Eigen::Index end) {
    for (Eigen::Index p = begin; p < end; ++p) {
      distances[p] = std::sqrt(tree.squared_distance(PointOf(points, p)));
    }
  });
  return distances;
}

struct NearestPoints::Search {
  explicit Search(const TriangleMesh& surface)
      : triangles(TrianglesOf(surface)), tree(triangles.begin(), triangles.end()) {
    tree.accelerate_distance_queries();
  }

  Triangles triangles;
  Tree tree;
};

NearestPoints::NearestPoints(const TriangleMesh& surface)
    : search_(std::make_unique<const Search>(surface)) {}

NearestPoints::~NearestPoints() = default;

Positions NearestPoints::Of(const Positions& points) const {
  Positions nearest(points.rows(), 3);
  for (Eigen::Index p = 0; p < points.rows(); ++p) {
    const Kernel::Point_3 at = search_->tree.closest_point(PointOf(points, p));
    nearest.row(p) << at.x(), at.y(), at.z();
  }
  return nearest;
}

SurfacePoints NearestPoints::WithNormals(const Positions& points) const {
  SurfacePoints nearest{.points = Positions(points.rows(), 3),
                        .normals = Positions(points.rows(), 3),
                        .triangles = {}};
  nearest.triangles.reserve(static_cast<size_t>(points.rows()));
  for (Eigen::Index p = 0; p < points.rows(); ++p) {
    const auto [at, triangle] = search_->tree.closest_point_and_primitive(PointOf(points, p));
    nearest.points.row(p) << at.x(), at.y(), at.z();
    nearest.normals.row(p) = NormalOf(*triangle);
    nearest.triangles.push_back(triangle - search_->triangles.begin());
  }
  return nearest;
}

}  // namespace tissueform
