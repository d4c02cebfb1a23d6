// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/vertex_cells.h"

#include <numeric>

namespace tissueform {

VertexCells::VertexCells(const Eigen::Ref<const CellIndices>& cells, Eigen::Index num_vertices)
    : offsets_(num_vertices + 1, 0), incidences_(cells.size()) {
  for (Eigen::Index c = 0; c < cells.rows(); ++c) {
    for (Eigen::Index corner = 0; corner < cells.cols(); ++corner) {
      ++offsets_[cells(c, corner) + 1];
    }
  }
  std::partial_sum(offsets_.begin(), offsets_.end(), offsets_.begin());
  std::vector<Eigen::Index> next(offsets_.begin(), offsets_.end() - 1);
  for (int32_t c = 0; c < cells.rows(); ++c) {
    for (int32_t corner = 0; corner < cells.cols(); ++corner) {
      incidences_[next[cells(c, corner)]++] = 4 * c + corner;
    }
  }
}

int64_t VertexCells::bytes_held() const {
  return static_cast<int64_t>(offsets_.size() * sizeof(Eigen::Index) +
                              incidences_.size() * sizeof(int32_t));
}

}  // namespace tissueform
