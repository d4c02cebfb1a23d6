// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/half_edges.h"

#include <algorithm>
#include <tuple>

namespace tissueform {
namespace {

std::vector<HalfEdge> SortedHalfEdges(const TriangleIndices& triangles) {
  std::vector<HalfEdge> half_edges;
  half_edges.reserve(static_cast<size_t>(3 * triangles.rows()));
  for (Eigen::Index f = 0; f < triangles.rows(); ++f) {
    for (int k = 0; k < 3; ++k) {
      const int32_t a = triangles(f, k);
      const int32_t b = triangles(f, (k + 1) % 3);
      half_edges.push_back({{std::min(a, b), std::max(a, b)}, a < b, static_cast<int32_t>(f)});
    }
  }
  std::sort(half_edges.begin(), half_edges.end(), [](const HalfEdge& a, const HalfEdge& b) {
    return std::tie(a.edge, a.triangle, a.runs_up) < std::tie(b.edge, b.triangle, b.runs_up);
  });
  return half_edges;
}

}  // namespace

void ForEachEdge(const TriangleIndices& triangles, const std::function<void(EdgeUses)>& visit) {
  const std::vector<HalfEdge> half_edges = SortedHalfEdges(triangles);
  for (size_t first = 0; first < half_edges.size();) {
    size_t last = first + 1;
    while (last < half_edges.size() && half_edges[last].edge == half_edges[first].edge) ++last;
    visit(EdgeUses(&half_edges[first], last - first));
    first = last;
  }
}

}  // namespace tissueform
