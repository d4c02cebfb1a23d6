// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/generation/old_surface.h"

#include <vector>

#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Simple_cartesian.h>
#include <Eigen/Geometry>

namespace tissueform {
namespace {

using Eigen::Vector3d;
using Kernel = CGAL::Simple_cartesian<double>;
using Triangles = std::vector<Kernel::Triangle_3>;
using Primitive = CGAL::AABB_triangle_primitive<Kernel, Triangles::const_iterator>;

}  // namespace

struct OldSurface::Tree {
  Triangles triangles;
  CGAL::AABB_tree<CGAL::AABB_traits<Kernel, Primitive>> nodes;
};

OldSurface::OldSurface(const TriangleMesh& surface) : tree_(std::make_unique<Tree>()) {
  const auto point = [&](int32_t v) {
    return Kernel::Point_3(surface.positions()(v, 0), surface.positions()(v, 1),
                           surface.positions()(v, 2));
  };
  tree_->triangles.reserve(static_cast<size_t>(surface.num_triangles()));
  for (const auto& t : surface.triangles().rowwise()) {
    tree_->triangles.emplace_back(point(t[0]), point(t[1]), point(t[2]));
  }
  tree_->nodes.insert(tree_->triangles.begin(), tree_->triangles.end());
  tree_->nodes.build();
  tree_->nodes.accelerate_distance_queries();
  // What the tree makes when it is first asked is made before threads ask it.
  if (!tree_->triangles.empty()) tree_->nodes.closest_point(tree_->triangles.front()[0]);
}

OldSurface::~OldSurface() = default;

OldSurface::Hit OldSurface::Nearest(const Vector3d& place) const {
  const auto [point, triangle] =
      tree_->nodes.closest_point_and_primitive({place.x(), place.y(), place.z()});
  const auto vector = [](const Kernel::Point_3& p) { return Vector3d(p.x(), p.y(), p.z()); };
  const Vector3d a = vector((*triangle)[0]);
  const Vector3d normal = (vector((*triangle)[1]) - a).cross(vector((*triangle)[2]) - a);
  return {vector(point), normal.stableNormalized()};
}

}  // namespace tissueform
