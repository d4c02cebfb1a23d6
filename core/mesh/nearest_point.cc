// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/nearest_point.h"

#include <algorithm>
#include <limits>
#include <utility>

#include <Eigen/Geometry>

namespace tissueform {

using Eigen::Index;
using Eigen::Vector3d;
using Eigen::Vector3i;

// By the region of the triangle's corners and edges that p lies over (Ericson 2005, 5.1.5).
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

NearbyTriangles::NearbyTriangles(const Positions& positions, const TriangleIndices& triangles,
                                 double reach_mm)
    : positions_(positions),
      triangles_(triangles),
      reach_mm_(reach_mm),
      normals_(triangles.rows(), 3) {
  if (triangles.rows() == 0) return;
  low_ = positions.colwise().minCoeff().transpose();
  cubes_ = CubeOf(positions.colwise().maxCoeff().transpose()) + Vector3i::Ones();
  for (Index f = 0; f < triangles.rows(); ++f) {
    const auto corner = [&](int k) -> Vector3d { return positions.row(triangles(f, k)); };
    normals_.row(f) = (corner(1) - corner(0)).cross(corner(2) - corner(0)).transpose();
    const Vector3i first = CubeOf(corner(0).cwiseMin(corner(1)).cwiseMin(corner(2)));
    const Vector3i last = CubeOf(corner(0).cwiseMax(corner(1)).cwiseMax(corner(2)));
    for (int z = first.z(); z <= last.z(); ++z) {
      for (int y = first.y(); y <= last.y(); ++y) {
        for (int x = first.x(); x <= last.x(); ++x) {
          entries_.emplace_back(KeyOf({x, y, z}), static_cast<int32_t>(f));
        }
      }
    }
  }
  std::sort(entries_.begin(), entries_.end());
}

std::optional<NearestOnSurface> NearbyTriangles::Nearest(const Vector3d& place,
                                                         const Vector3d& normal) const {
  std::optional<NearestOnSurface> nearest;
  double least_mm = reach_mm_;
  const auto look_at = [&](int32_t f) {
    if (normals_.row(f).dot(normal) <= 0) return;
    const auto corner = [&](int k) -> Vector3d { return positions_.row(triangles_(f, k)); };
    const Vector3d shares = NearestShares(place, corner(0), corner(1), corner(2));
    const double distance =
        (shares[0] * corner(0) + shares[1] * corner(1) + shares[2] * corner(2) - place).norm();
    if (distance > least_mm || (nearest && distance == least_mm)) return;
    least_mm = distance;
    nearest = NearestOnSurface{f, shares, distance};
  };
  const Vector3i middle = CubeOf(place);
  const Vector3i first = (middle - Vector3i::Ones()).cwiseMax(0);
  const Vector3i last = (middle + Vector3i::Ones()).cwiseMin(cubes_ - Vector3i::Ones());
  for (int z = first.z(); z <= last.z(); ++z) {
    for (int y = first.y(); y <= last.y(); ++y) {
      for (int x = first.x(); x <= last.x(); ++x) {
        const std::pair<int64_t, int32_t> begin = {KeyOf({x, y, z}), 0};
        for (auto at = std::lower_bound(entries_.begin(), entries_.end(), begin);
             at != entries_.end() && at->first == begin.first; ++at) {
          look_at(at->second);
        }
      }
    }
  }
  return nearest;
}

// Far outside of the surface's box numbers stay small.
Vector3i NearbyTriangles::CubeOf(const Vector3d& place) const {
  const Vector3d cube = ((place - low_) / reach_mm_).array().floor();
  return cube.cwiseMax(-2).cwiseMin(1e6).cast<int>();
}

int64_t NearbyTriangles::KeyOf(const Vector3i& cube) const {
  return cube.x() + int64_t{cubes_.x()} * (cube.y() + int64_t{cubes_.y()} * cube.z());
}

}  // namespace tissueform
