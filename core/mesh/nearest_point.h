// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/types.h"

namespace tissueform {

// Shares of a, b, c in the point of their triangle that is nearest to p: at least 0, one in sum.
Eigen::Vector3d NearestShares(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                              const Eigen::Vector3d& b, const Eigen::Vector3d& c);

// Where a place is nearest to a surface.
struct NearestOnSurface {
  Eigen::Index triangle = 0;
  Eigen::Vector3d shares = Eigen::Vector3d::Zero();  // of its corners
  double distance_mm = 0;
};

// Answers which point of a surface is nearest, within a reach that is given beforehand: triangles
// lie in cubes of that size, so that few are looked at. Constant once made; any thread.
class NearbyTriangles {
 public:
  // `triangles`, #F by 3, of `positions`, #V by 3, which must outlive this. REQUIRES: finite
  // positions, reach_mm > 0.
  NearbyTriangles(const Positions& positions, const TriangleIndices& triangles, double reach_mm);

  // The nearest of those triangles that face as `normal` does (their normals and it have a positive
  // product); nothing where none lies within the reach.
  std::optional<NearestOnSurface> Nearest(const Eigen::Vector3d& place,
                                          const Eigen::Vector3d& normal) const;

 private:
  Eigen::Vector3i CubeOf(const Eigen::Vector3d& place) const;
  int64_t KeyOf(const Eigen::Vector3i& cube) const;

  const Positions& positions_;
  const TriangleIndices& triangles_;
  const double reach_mm_;
  Positions normals_;
  Eigen::Vector3d low_ = Eigen::Vector3d::Zero();
  Eigen::Vector3i cubes_ = Eigen::Vector3i::Ones();
  // (cube, triangle), sorted; a triangle stands in every cube that its box meets.
  std::vector<std::pair<int64_t, int32_t>> entries_;
};

}  // namespace tissueform
