// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/plan_fitting/skin_points.h"

#include <algorithm>
#include <limits>

#include <Eigen/LU>

#include "core/mesh/nearest_point.h"

namespace tissueform {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

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
    // Checking one corner is enough to see that most facets are too far.
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
