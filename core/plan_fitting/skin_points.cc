// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/plan_fitting/skin_points.h"

#include <algorithm>
#include <limits>

#include <Eigen/Geometry>
#include <Eigen/LU>

namespace tissueform {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

// Shares of a, b, c in the point of their triangle that is nearest to p: by the region of the
// triangle's corners and edges that p lies over (Ericson 2005, 5.1.5).
Vector3d NearestShares(const Vector3d& p, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const Vector3d ab = b - a;
  const Vector3d ac = c - a;
  const double d1 = ab.dot(p - a);
  const double d2 = ac.dot(p - a);
  if (d1 <= 0 && d2 <= 0) return {1, 0, 0};
  const double d3 = ab.dot(p - b);
  const double d4 = ac.dot(p - b);
  if (d3 >= 0 && d4 <= d3) return {0, 1, 0};
  const double over_ab = d1 * d4 - d3 * d2;
  if (over_ab <= 0 && d1 >= 0 && d3 <= 0) {
    const double t = d1 / (d1 - d3);
    return {1 - t, t, 0};
  }
  const double d5 = ab.dot(p - c);
  const double d6 = ac.dot(p - c);
  if (d6 >= 0 && d5 <= d6) return {0, 0, 1};
  const double over_ac = d5 * d2 - d1 * d6;
  if (over_ac <= 0 && d2 >= 0 && d6 <= 0) {
    const double t = d2 / (d2 - d6);
    return {1 - t, 0, t};
  }
  const double over_bc = d3 * d6 - d5 * d4;
  if (over_bc <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    const double t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return {0, 1 - t, t};
  }
  const double whole = over_ab + over_ac + over_bc;
  return {over_bc / whole, over_ac / whole, over_ab / whole};
}

}  // namespace

Vector3d PositionOf(const MeshPoint& point, const Positions& positions) {
  Vector3d position = Vector3d::Zero();
  for (size_t k = 0; k < point.vertices.size(); ++k) {
    position += point.shares[k] * positions.row(point.vertices[k]).transpose();
  }
  return position;
}

MeshPoint MeanOfVertices(const std::vector<int32_t>& vertices) {
  return {vertices,
          std::vector<double>(vertices.size(), 1.0 / static_cast<double>(vertices.size()))};
}

SkinFacets::SkinFacets(const TetMesh& mesh, const TriangleIndices& boundary,
                       const ConstraintSet& constraints)
    : mesh_(mesh) {
  std::vector<char> is_constrained(static_cast<size_t>(mesh.num_vertices()), 0);
  for (const int32_t v : constraints.constrained()) is_constrained[static_cast<size_t>(v)] = 1;
  std::vector<Index> skin;
  for (Index f = 0; f < boundary.rows(); ++f) {
    const bool is_bone = is_constrained[static_cast<size_t>(boundary(f, 0))] != 0 &&
                         is_constrained[static_cast<size_t>(boundary(f, 1))] != 0 &&
                         is_constrained[static_cast<size_t>(boundary(f, 2))] != 0;
    if (!is_bone) skin.push_back(f);
  }
  facets_ = boundary(skin, Eigen::all);
  longest_edges_mm_.resize(facets_.rows());
  for (Index f = 0; f < facets_.rows(); ++f) {
    const auto corner = [&](int k) { return mesh.positions().row(facets_(f, k)); };
    longest_edges_mm_[f] = std::max((corner(1) - corner(0)).norm(), (corner(2) - corner(0)).norm());
  }
}

NearestSkin SkinFacets::Nearest(const Vector3d& place) const {
  const Positions& positions = mesh_.positions();
  NearestSkin nearest;
  nearest.distance_mm = std::numeric_limits<double>::infinity();
  for (Index f = 0; f < facets_.rows(); ++f) {
    const Vector3d a = positions.row(facets_(f, 0));
    // Most facets are told to be too far by one of their corners.
    if ((place - a).norm() - longest_edges_mm_[f] > nearest.distance_mm) continue;
    const Vector3d b = positions.row(facets_(f, 1));
    const Vector3d c = positions.row(facets_(f, 2));
    const Vector3d shares = NearestShares(place, a, b, c);
    const Vector3d position = shares[0] * a + shares[1] * b + shares[2] * c;
    const double distance = (place - position).norm();
    if (distance >= nearest.distance_mm) continue;
    nearest.distance_mm = distance;
    nearest.position = position;
    nearest.point = {{facets_(f, 0), facets_(f, 1), facets_(f, 2)},
                     {shares[0], shares[1], shares[2]}};
  }
  return nearest;
}

bool SkinFacets::IsInTissue(const Vector3d& place) const {
  const Positions& positions = mesh_.positions();
  for (Index t = 0; t < mesh_.num_tets(); ++t) {
    const auto corner = [&](int k) -> Vector3d { return positions.row(mesh_.tets()(t, k)); };
    const Vector3d last = corner(3);
    Eigen::Matrix3d edges;
    edges << corner(0) - last, corner(1) - last, corner(2) - last;
    const Vector3d shares = edges.inverse() * (place - last);
    if (shares.minCoeff() >= 0 && shares.sum() <= 1) return true;
  }
  return false;
}

}  // namespace tissueform
