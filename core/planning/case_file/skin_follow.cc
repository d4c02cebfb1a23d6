// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/case_file/skin_follow.h"

#include <algorithm>
#include <optional>

#include <Eigen/Geometry>

#include "core/mesh/nearest_point.h"
#include "core/planning/case_file/mesh_surfaces.h"

namespace tissueform {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

// Means of the normals of the triangles about each vertex, weighted by area; not of length one.
Positions VertexNormals(const Positions& positions, const TriangleIndices& triangles) {
  Positions normals = Positions::Zero(positions.rows(), 3);
  for (Index f = 0; f < triangles.rows(); ++f) {
    const auto corner = [&](int k) -> Vector3d { return positions.row(triangles(f, k)); };
    const Vector3d normal = (corner(1) - corner(0)).cross(corner(2) - corner(0));
    for (int k = 0; k < 3; ++k) normals.row(triangles(f, k)) += normal.transpose();
  }
  return normals;
}

// 1 up to kFollowsFullyMm, 0 from kFollowsMm on, without a kink at either.
double ShareAt(double distance_mm) {
  const double t =
      std::clamp((distance_mm - kFollowsFullyMm) / (kFollowsMm - kFollowsFullyMm), 0.0, 1.0);
  return 1 - t * t * (3 - 2 * t);
}

}  // namespace

FollowedVertices FollowSkin(const FloatPositions& positions, const TriangleIndices& triangles,
                            const TetMesh& mesh, const ConstraintSet& constraints) {
  FollowedVertices follows;
  follows.vertices.setZero(positions.rows(), 3);
  follows.weights.setZero(positions.rows(), 3);
  const std::optional<CaseSurface> skin = SkinOfMesh(mesh, constraints, {});
  if (!skin) return follows;
  const auto& of_mesh = skin->follows->vertices;
  const Positions mesh_skin = skin->positions.cast<double>();
  const NearbyTriangles nearby(mesh_skin, skin->triangles, kFollowsMm);
  const Positions places = positions.cast<double>();
  const Positions normals = VertexNormals(places, triangles);
  for (Index v = 0; v < places.rows(); ++v) {
    const std::optional<NearestOnSurface> nearest =
        nearby.Nearest(places.row(v).transpose(), normals.row(v).transpose());
    if (!nearest) continue;
    const double share = ShareAt(nearest->distance_mm);
    for (int k = 0; k < 3; ++k) {
      follows.vertices(v, k) = of_mesh(skin->triangles(nearest->triangle, k), 0);
      follows.weights(v, k) = static_cast<float>(share * nearest->shares[k]);
    }
  }
  return follows;
}

std::vector<uint8_t> RegionsOfFollowers(const FollowedVertices& follows,
                                        const std::vector<uint8_t>& region_of_vertex) {
  std::vector<uint8_t> regions;
  if (region_of_vertex.empty()) return regions;
  regions.reserve(static_cast<size_t>(follows.weights.rows()));
  for (Index v = 0; v < follows.weights.rows(); ++v) {
    Index most = 0;
    const bool follows_any = follows.weights.row(v).maxCoeff(&most) > 0;
    const auto followed = static_cast<size_t>(follows.vertices(v, most));
    regions.push_back(follows_any ? region_of_vertex[followed] : 0);
  }
  return regions;
}

}  // namespace tissueform
