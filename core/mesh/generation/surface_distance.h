// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <vector>

#include "core/base/types.h"
#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// Distances of points (#P by 3) to the nearest point of a surface, #P, in mm. By a search tree
// (CGAL). They do not depend on `threads`.
//
// REQUIRES: positions are finite.
Eigen::VectorXd DistancesToSurface(const Positions& points, const TriangleMesh& surface,
                                   int threads = 1);

// Points of a surface, #P by 3, the unit normals of the triangles in which they lie (0 0 0 where
// one has no area), and the numbers of these triangles.
struct SurfacePoints {
  Positions points;
  Positions normals;
  std::vector<Eigen::Index> triangles;
};

// The points of one surface that are nearest to other points, by a search tree that is made once.
// Not for several threads at a time.
//
// REQUIRES: positions are finite.
class NearestPoints {
 public:
  explicit NearestPoints(const TriangleMesh& surface);
  ~NearestPoints();
  NearestPoints(const NearestPoints&) = delete;
  NearestPoints& operator=(const NearestPoints&) = delete;

  // For points (#P by 3), #P by 3.
  Positions Of(const Positions& points) const;
  SurfacePoints WithNormals(const Positions& points) const;

 private:
  struct Search;
  const std::unique_ptr<const Search> search_;
};

}  // namespace tissueform
