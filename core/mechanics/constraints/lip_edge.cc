// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/constraints/lip_edge.h"

#include <cmath>
#include <cstddef>
#include <set>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr double kRoundingOfUp = 1e-6;

using VertexPairs = std::set<std::pair<int32_t, int32_t>>;

absl::Status BadEdge(const std::string& what) {
  return absl::InvalidArgumentError(absl::StrCat("contact seal: ", what));
}

VertexPairs PairsWithRows(const std::vector<ContactRow>& rows) {
  VertexPairs pairs;
  for (const ContactRow& row : rows) {
    pairs.insert({row.vertex, row.other});
    pairs.insert({row.other, row.vertex});
  }
  return pairs;
}

absl::Status CheckVertices(size_t number, const LipEdge::Pair& pair, Eigen::Index num_vertices,
                           std::set<int32_t>* seen) {
  for (const int32_t vertex : {pair.upper, pair.lower}) {
    if (vertex < 0 || vertex >= num_vertices) {
      return BadEdge(absl::StrCat("pair ", number, " names vertex ", vertex,
                                  ", but the mesh has vertices 0 to ", num_vertices - 1));
    }
    if (!seen->insert(vertex).second) {
      return BadEdge(absl::StrCat("pair ", number, " names vertex ", vertex,
                                  " again; a vertex belongs to one pair"));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckLipEdge(const LipEdge& edge, const Positions& rest,
                          const std::vector<ContactRow>& rows) {
  if (!(std::abs(edge.up.norm() - 1) <= kRoundingOfUp)) {
    return BadEdge(absl::StrCat("\"up\" has length ", edge.up.norm(), "; it must be 1"));
  }
  if (edge.pairs.empty()) return BadEdge("there are no pairs; leave the seal out");
  const VertexPairs with_rows = PairsWithRows(rows);
  std::set<int32_t> seen;
  for (size_t number = 0; number < edge.pairs.size(); ++number) {
    const LipEdge::Pair& pair = edge.pairs[number];
    TF_RETURN_IF_ERROR(CheckVertices(number, pair, rest.rows(), &seen));
    if (rest.row(pair.upper) != rest.row(pair.lower)) {
      return BadEdge(absl::StrCat("the vertices ", pair.upper, " and ", pair.lower, " of pair ",
                                  number, " are not at one place at rest; remove the pair"));
    }
    if (!with_rows.contains({pair.upper, pair.lower})) {
      return BadEdge(absl::StrCat("pair ", number,
                                  " has no contact row between its vertices; add it, or remove the "
                                  "pair"));
    }
  }
  return absl::OkStatus();
}

}  // namespace tissueform
