// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// Which triangles of a surface go through each other.
struct TriangleIntersections {
  // Pairs of triangles, each with its lower number first, sorted.
  std::vector<std::array<int32_t, 2>> pairs;
  bool complete = true;  // false: the search ended at the most pairs
};

// Two triangles intersect when they have a point in common that is not on a vertex or edge that
// they share; vertices at exactly one place count as shared. Triangles that share all three
// vertices, and triangles without area, are other defects and left out. Decided with exact
// predicates (CGAL), so it does not depend on a tolerance, for any set of triangles, manifold or
// not.
//
// REQUIRES: positions are finite.
TriangleIntersections FindTriangleIntersections(const TriangleMesh& mesh,
                                                int64_t most_pairs = 1000000);

}  // namespace tissueform
