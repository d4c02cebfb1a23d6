// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <array>
#include <map>
#include <numeric>
#include <utility>

#include "absl/status/status.h"

#include "core/base/status_macros.h"
#include "core/mesh/seam/seam_sheet.h"
#include "core/mesh/tet_topology.h"
#include "core/mesh/vertex_cells.h"

namespace tissueform {
namespace {

using Facet = std::array<int32_t, 3>;  // rising

Facet Sorted(int32_t a, int32_t b, int32_t c) {
  Facet facet = {a, b, c};
  std::sort(facet.begin(), facet.end());
  return facet;
}

// 1 and -1: above and below the sheet. 0: it crosses the sheet's surface beyond its rim.
int SideOf(const Eigen::Ref<const Eigen::Matrix<int32_t, 1, 4>>& tet,
           const std::vector<int8_t>& side) {
  bool above = false;
  bool below = false;
  for (const int32_t v : tet) {
    above |= side[static_cast<size_t>(v)] > 0;
    below |= side[static_cast<size_t>(v)] < 0;
  }
  if (above && below) return 0;
  return below ? -1 : 1;
}

// The two tets at a facet, with the facet as the one above has it.
struct Opening {
  int32_t above = -1;
  int32_t below = -1;
  Facet facing_down = {0, 0, 0};  // out of the tet above
};

class Parting {
 public:
  Parting(const TetMesh& mesh, const std::vector<int8_t>& side) : mesh_(mesh), side_(side) {
    for (Eigen::Index t = 0; t < mesh.num_tets(); ++t) Visit(static_cast<int32_t>(t));
    std::erase_if(openings_, [](const auto& entry) {
      return entry.second.above < 0 || entry.second.below < 0;
    });
  }

  absl::StatusOr<PartedMesh> Run(const std::vector<bool>& stays_joined) {
    if (openings_.empty()) {
      return absl::InvalidArgumentError("the seam parts nothing; correct its line");
    }
    TetIndices tets = mesh_.tets();
    std::vector<int32_t> originals;
    for (const int32_t v : VerticesOfSheet()) {
      if (stays_joined.empty() || !stays_joined[static_cast<size_t>(v)]) {
        Double(v, &tets, &originals);
      }
    }
    if (originals.empty()) {
      return absl::InvalidArgumentError(
          "the seam lies within the tissue and opens nowhere; correct its line");
    }
    const Eigen::Index old_size = mesh_.num_vertices();
    Positions positions(old_size + static_cast<Eigen::Index>(originals.size()), 3);
    positions.topRows(old_size) = mesh_.positions();
    for (size_t k = 0; k < originals.size(); ++k) {
      positions.row(old_size + static_cast<Eigen::Index>(k)) = mesh_.positions().row(originals[k]);
    }
    TF_ASSIGN_OR_RETURN(TetMesh parted, TetMesh::Create(std::move(positions), std::move(tets)));
    return PartedMesh{std::move(parted), std::move(originals), Wall()};
  }

 private:
  // Only facets with all corners on the sheet open.
  void Visit(int32_t t) {
    const Eigen::Matrix<int32_t, 1, 4> tet = mesh_.tets().row(t);
    const int tet_side = SideOf(tet, side_);
    if (tet_side == 0) return;
    for (const auto& corners : kTetFacets) {
      const Facet facet = {tet[corners[0]], tet[corners[1]], tet[corners[2]]};
      const bool in_sheet =
          std::all_of(facet.begin(), facet.end(), [this](int32_t v) { return side_[v] == 0; });
      if (!in_sheet) continue;
      Opening& opening = openings_[Sorted(facet[0], facet[1], facet[2])];
      (tet_side > 0 ? opening.above : opening.below) = t;
      if (tet_side > 0) opening.facing_down = facet;
    }
  }

  std::vector<int32_t> VerticesOfSheet() const {
    std::vector<int32_t> vertices;
    for (const auto& [facet, opening] : openings_) {
      vertices.insert(vertices.end(), facet.begin(), facet.end());
    }
    std::sort(vertices.begin(), vertices.end());
    vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
    return vertices;
  }

  // Numbers of groups, one for each tet of `about`: those that hang together about the vertex
  // without passing the sheet.
  std::vector<int> Groups(int32_t vertex, const std::vector<int32_t>& about) const {
    std::vector<int> group(about.size());
    std::iota(group.begin(), group.end(), 0);
    std::map<Facet, int> first_at;
    for (int k = 0; k < static_cast<int>(about.size()); ++k) {
      const auto tet = mesh_.tets().row(about[k]);
      for (const auto& corners : kTetFacets) {
        const Facet facet = Sorted(tet[corners[0]], tet[corners[1]], tet[corners[2]]);
        const bool joins = std::find(facet.begin(), facet.end(), vertex) != facet.end() &&
                           !openings_.contains(facet);
        if (!joins) continue;
        const auto [other, is_new] = first_at.try_emplace(facet, k);
        if (is_new) continue;
        const int from = group[k];
        const int to = group[other->second];
        std::replace(group.begin(), group.end(), from, to);
      }
    }
    return group;
  }

  // The group that holds a tet above the sheet keeps the vertex; each other gets a double.
  void Double(int32_t vertex, TetIndices* tets, std::vector<int32_t>* originals) const {
    std::vector<int32_t> about;
    for (Eigen::Index k = cells_.begin(vertex); k < cells_.end(vertex); ++k) {
      about.push_back(cells_.cell(k));
    }
    const std::vector<int> group = Groups(vertex, about);
    int kept = group.front();
    for (size_t k = 0; k < about.size(); ++k) {
      if (SideOf(mesh_.tets().row(about[k]), side_) > 0) kept = group[k];
    }
    std::map<int, int32_t> double_of;
    for (size_t k = 0; k < about.size(); ++k) {
      if (group[k] == kept) continue;
      const auto number =
          static_cast<int32_t>(mesh_.num_vertices() + static_cast<Eigen::Index>(originals->size()));
      const auto [place, is_new] = double_of.try_emplace(group[k], number);
      if (is_new) originals->push_back(vertex);
      for (int corner = 0; corner < 4; ++corner) {
        int32_t& v = (*tets)(about[k], corner);
        if (v == vertex) v = place->second;
      }
    }
  }

  TriangleIndices Wall() const {
    TriangleIndices wall(static_cast<Eigen::Index>(openings_.size()), 3);
    Eigen::Index row = 0;
    for (const auto& [facet, opening] : openings_) {
      const Facet& down = opening.facing_down;
      wall.row(row++) << down[0], down[2], down[1];
    }
    return wall;
  }

  const TetMesh& mesh_;
  const std::vector<int8_t>& side_;
  VertexCells cells_{mesh_.tets(), mesh_.num_vertices()};
  std::map<Facet, Opening> openings_;
};

}  // namespace

absl::StatusOr<PartedMesh> PartMesh(const TetMesh& mesh, const std::vector<int8_t>& side,
                                    const std::vector<bool>& stays_joined) {
  return Parting(mesh, side).Run(stays_joined);
}

}  // namespace tissueform
