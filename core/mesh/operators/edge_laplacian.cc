// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/operators/edge_laplacian.h"

#include <algorithm>
#include <vector>

#include "core/base/parallel_for.h"
#include "core/mesh/tet_topology.h"

namespace tissueform {
namespace {

// Columns that one thread takes at a time.
constexpr Eigen::Index kColumnGrain = 1024;

// Number of the edge between two corners, for tets and for triangles.
using EdgeOfCorners = std::array<std::array<int, 4>, 4>;

template <size_t N>
constexpr EdgeOfCorners InvertEdges(const std::array<std::array<int, 2>, N>& edges) {
  EdgeOfCorners inverse{};
  for (size_t e = 0; e < N; ++e) {
    inverse[edges[e][0]][edges[e][1]] = static_cast<int>(e);
    inverse[edges[e][1]][edges[e][0]] = static_cast<int>(e);
  }
  return inverse;
}

constexpr EdgeOfCorners kTetEdgeOfCorners = InvertEdges(kTetEdges);
constexpr EdgeOfCorners kTriangleEdgeOfCorners = InvertEdges(kTriangleEdges);

// Gathers columns of the Laplacian from the cells around their vertices. One for each thread.
class ColumnGatherer {
 public:
  ColumnGatherer(const Eigen::Ref<const CellIndices>& cells, const VertexCells& vertex_cells,
                 const Eigen::Ref<const CellEdgeWeights>& edge_weights, Eigen::Index num_vertices)
      : cells_(cells),
        vertex_cells_(vertex_cells),
        edge_weights_(edge_weights),
        edge_of_corners_(cells.cols() == 4 ? kTetEdgeOfCorners : kTriangleEdgeOfCorners),
        sums_(num_vertices, 0.0),
        seen_in_(num_vertices, -1) {}

  // Rows of the column, rising, with the entries in sum().
  const std::vector<int32_t>& Gather(int32_t vertex) {
    rows_.clear();
    for (Eigen::Index k = vertex_cells_.begin(vertex); k < vertex_cells_.end(vertex); ++k) {
      const int32_t cell = vertex_cells_.cell(k);
      const int own = vertex_cells_.corner(k);
      for (int corner = 0; corner < cells_.cols(); ++corner) {
        if (corner != own) {
          const double weight = edge_weights_(cell, edge_of_corners_[own][corner]);
          Add(vertex, cells_(cell, corner), -weight);
          Add(vertex, vertex, weight);
        }
      }
    }
    std::sort(rows_.begin(), rows_.end());
    return rows_;
  }

  double sum(int32_t row) const { return sums_[row]; }

 private:
  void Add(int32_t column, int32_t row, double value) {
    if (seen_in_[row] != column) {
      seen_in_[row] = column;
      sums_[row] = 0;
      rows_.push_back(row);
    }
    sums_[row] += value;
  }

  const Eigen::Ref<const CellIndices>& cells_;
  const VertexCells& vertex_cells_;
  const Eigen::Ref<const CellEdgeWeights>& edge_weights_;
  const EdgeOfCorners& edge_of_corners_;

  std::vector<double> sums_;
  std::vector<int32_t> seen_in_;  // the column for which sums_ is valid
  std::vector<int32_t> rows_;
};

// A run of consecutive columns.
struct ColumnBlock {
  std::vector<int32_t> column_sizes;
  std::vector<int32_t> rows;
  std::vector<double> values;
};

SparseMatrix Join(const std::vector<ColumnBlock>& blocks, Eigen::Index num_vertices) {
  SparseMatrix L(num_vertices, num_vertices);
  Eigen::Index entries = 0;
  for (const ColumnBlock& block : blocks) {
    entries += static_cast<Eigen::Index>(block.rows.size());
  }
  L.resizeNonZeros(entries);
  int32_t* outer = L.outerIndexPtr();
  int32_t* inner = L.innerIndexPtr();
  double* values = L.valuePtr();
  *outer = 0;
  for (const ColumnBlock& block : blocks) {
    for (const int32_t size : block.column_sizes) {
      outer[1] = outer[0] + size;
      ++outer;
    }
    inner = std::copy(block.rows.begin(), block.rows.end(), inner);
    values = std::copy(block.values.begin(), block.values.end(), values);
  }
  return L;
}

}  // namespace

SparseMatrix AssembleEdgeLaplacian(const Eigen::Ref<const CellIndices>& cells,
                                   Eigen::Index num_vertices,
                                   const Eigen::Ref<const CellEdgeWeights>& edge_weights,
                                   int threads) {
  const VertexCells vertex_cells(cells, num_vertices);
  std::vector<ColumnBlock> blocks((num_vertices + kColumnGrain - 1) / kColumnGrain);
  ParallelFor(threads, num_vertices, kColumnGrain, [&](Eigen::Index begin, Eigen::Index end) {
    ColumnGatherer gatherer(cells, vertex_cells, edge_weights, num_vertices);
    for (Eigen::Index column = begin; column < end; ++column) {
      ColumnBlock& block = blocks[column / kColumnGrain];
      const auto& rows = gatherer.Gather(static_cast<int32_t>(column));
      block.column_sizes.push_back(static_cast<int32_t>(rows.size()));
      for (const int32_t row : rows) {
        block.rows.push_back(row);
        block.values.push_back(gatherer.sum(row));
      }
    }
  });
  return Join(blocks, num_vertices);
}

SparseMatrix UniformLaplacian(const Eigen::Ref<const CellIndices>& cells, Eigen::Index num_vertices,
                              int threads) {
  const Eigen::Index edges_per_cell = cells.cols() == 4 ? 6 : 3;
  SparseMatrix L = AssembleEdgeLaplacian(
      cells, num_vertices, CellEdgeWeights::Ones(cells.rows(), edges_per_cell), threads);
  for (Eigen::Index column = 0; column < L.cols(); ++column) {
    const auto degree =
        static_cast<double>(L.outerIndexPtr()[column + 1] - L.outerIndexPtr()[column] - 1);
    for (SparseMatrix::InnerIterator entry(L, column); entry; ++entry) {
      entry.valueRef() = entry.row() == column ? degree : -1.0;
    }
  }
  return L;
}

Eigen::Index CountNegativeWeights(const SparseMatrix& L) {
  // Weights that vanish exactly (the diagonals of a grid's cubes) come out as rounding noise of
  // either sign.
  constexpr double kRounding = 1e-12;
  const Eigen::VectorXd diagonal = L.diagonal();
  Eigen::Index negative = 0;
  for (Eigen::Index column = 0; column < L.outerSize(); ++column) {
    for (SparseMatrix::InnerIterator entry(L, column); entry; ++entry) {
      const double noise = kRounding * std::max(diagonal[entry.row()], diagonal[column]);
      negative += entry.row() < column && entry.value() > noise ? 1 : 0;
    }
  }
  return negative;
}

}  // namespace tissueform
