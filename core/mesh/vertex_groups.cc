// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/vertex_groups.h"

#include <algorithm>
#include <array>
#include <numeric>

namespace tissueform {

std::vector<int32_t> FirstVertexAtSamePlace(const Positions& positions) {
  std::vector<int32_t> order(static_cast<size_t>(positions.rows()));
  std::iota(order.begin(), order.end(), 0);
  const auto place = [&](int32_t v) {
    return std::array<double, 3>{positions(v, 0), positions(v, 1), positions(v, 2)};
  };
  // Compared as numbers, so that 0 and -0 are one place, and without a tolerance: vertices that are
  // nearly at one place may well be meant. Stable: the first of several is the one with the lowest
  // number.
  std::stable_sort(order.begin(), order.end(),
                   [&](int32_t a, int32_t b) { return place(a) < place(b); });
  std::vector<int32_t> first(order.size());
  for (size_t k = 0; k < order.size(); ++k) {
    const bool is_same = k > 0 && place(order[k]) == place(order[k - 1]);
    first[order[k]] = is_same ? first[order[k - 1]] : order[k];
  }
  return first;
}

std::vector<Eigen::Index> DuplicateVertices(const std::vector<int32_t>& first_at_place) {
  std::vector<Eigen::Index> duplicates;
  for (size_t v = 0; v < first_at_place.size(); ++v) {
    if (first_at_place[v] != static_cast<int32_t>(v)) {
      duplicates.push_back(static_cast<Eigen::Index>(v));
    }
  }
  return duplicates;
}

std::vector<Eigen::Index> UnreferencedVertices(const std::vector<int32_t>& component_of_vertex) {
  std::vector<Eigen::Index> unreferenced;
  for (size_t v = 0; v < component_of_vertex.size(); ++v) {
    if (component_of_vertex[v] < 0) unreferenced.push_back(static_cast<Eigen::Index>(v));
  }
  return unreferenced;
}

std::vector<Eigen::Index> FirstVertexOfComponents(const std::vector<int32_t>& component_of_vertex,
                                                  int32_t count) {
  std::vector<Eigen::Index> first(static_cast<size_t>(count), -1);
  for (size_t v = 0; v < component_of_vertex.size(); ++v) {
    const int32_t component = component_of_vertex[v];
    if (component >= 0 && first[component] < 0) first[component] = static_cast<Eigen::Index>(v);
  }
  return first;
}

}  // namespace tissueform
