// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "core/base/types.h"

namespace tissueform {

// Vertex indices of cells of one kind, #C by 4 (tets) or by 3 (triangles).
using CellIndices = Eigen::Matrix<int32_t, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// For every vertex the cells that hold it, in rising order. Immutable.
class VertexCells {
 public:
  // REQUIRES: indices in [0, num_vertices); fewer than 2^29 cells.
  VertexCells(const Eigen::Ref<const CellIndices>& cells, Eigen::Index num_vertices);

  // Entry k of the incidences of v lies at positions begin(v) <= k < end(v).
  Eigen::Index begin(Eigen::Index vertex) const { return offsets_[vertex]; }
  Eigen::Index end(Eigen::Index vertex) const { return offsets_[vertex + 1]; }
  int32_t cell(Eigen::Index k) const { return incidences_[k] >> 2; }
  int corner(Eigen::Index k) const { return incidences_[k] & 3; }
  Eigen::Index num_incidences() const { return static_cast<Eigen::Index>(incidences_.size()); }
  int64_t bytes_held() const;

 private:
  std::vector<Eigen::Index> offsets_;  // #V + 1
  std::vector<int32_t> incidences_;    // 4 * cell + corner
};

}  // namespace tissueform
