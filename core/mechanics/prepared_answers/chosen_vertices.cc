// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/chosen_vertices.h"

#include <algorithm>

namespace tissueform {
namespace {

static_assert(ConstraintSet::kFixed == PortableAnswers::kFixed);

// Of every vertex of the mesh: its handle, kFixed or kFree.
std::vector<int32_t> RegionsOf(Eigen::Index num_vertices, const ConstraintSet& constraints) {
  std::vector<int32_t> regions(static_cast<size_t>(num_vertices), PortableAnswers::kFree);
  for (size_t i = 0; i < constraints.constrained().size(); ++i) {
    regions[static_cast<size_t>(constraints.constrained()[i])] =
        constraints.region_of_constrained()[i];
  }
  return regions;
}

template <typename Value>
void Append(const Eigen::RowVector3d& at, std::vector<Value>* values) {
  for (const double coordinate : at) values->push_back(static_cast<Value>(coordinate));
}

}  // namespace

std::vector<int32_t> DescribeVertices(const Positions& rest, const ConstraintSet& constraints,
                                      const std::vector<int32_t>& vertices,
                                      PortableAnswers* answers) {
  answers->numbers.num_vertices = static_cast<double>(vertices.size());
  answers->numbers.num_handles = static_cast<double>(constraints.handles().size());
  const std::vector<int32_t> regions = RegionsOf(rest.rows(), constraints);
  std::vector<int32_t> free;
  double largest = 0;
  for (const int32_t vertex : vertices) {
    const int32_t region = regions[static_cast<size_t>(vertex)];
    answers->regions.push_back(region);
    const Eigen::RowVector3d at = rest.row(vertex);
    if (region == PortableAnswers::kFree) {
      free.push_back(vertex);
      Append(at, &answers->free_rest);
      largest = std::max(largest, at.norm());
    } else if (region == PortableAnswers::kFixed) {
      Append(at, &answers->fixed_rest);
    } else {
      Append(at, &answers->handle_rest);
    }
  }
  answers->numbers.largest_rest_mm = largest;
  return free;
}

}  // namespace tissueform
