// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/elasticity/vertex_blocks.h"

#include <algorithm>
#include <vector>

#include "core/base/parallel_for.h"

namespace tissueform {
namespace {

// Vertices that one thread takes at a time.
constexpr Eigen::Index kVertexGrain = 1024;

// The vertices that share a tet with a vertex, itself among them, rising.
void CollectNeighbours(const PiecewiseLinearElements& elements, const VertexCells& vertex_cells,
                       Eigen::Index vertex, std::vector<int32_t>* neighbours) {
  neighbours->clear();
  for (Eigen::Index k = vertex_cells.begin(vertex); k < vertex_cells.end(vertex); ++k) {
    const int32_t* corners = elements.cells.data() + Eigen::Index{4} * vertex_cells.cell(k);
    neighbours->insert(neighbours->end(), corners, corners + 4);
  }
  std::sort(neighbours->begin(), neighbours->end());
  neighbours->erase(std::unique(neighbours->begin(), neighbours->end()), neighbours->end());
}

// K with its columns laid out and nothing in them yet.
SparseMatrix LayOutColumns(const PiecewiseLinearElements& elements, const VertexCells& vertex_cells,
                           int threads) {
  const Eigen::Index num_vertices = elements.num_vertices();
  std::vector<int32_t> counts(num_vertices);
  ParallelFor(threads, num_vertices, kVertexGrain, [&](Eigen::Index begin, Eigen::Index end) {
    std::vector<int32_t> neighbours;
    for (Eigen::Index v = begin; v < end; ++v) {
      CollectNeighbours(elements, vertex_cells, v, &neighbours);
      counts[v] = static_cast<int32_t>(neighbours.size());
    }
  });
  // The columns are laid out before they are filled, so that threads write to places of their own.
  // A list of triplets would hold 144 of them a tet, several times the matrix, and sort them.
  SparseMatrix K(3 * num_vertices, 3 * num_vertices);
  int32_t* outer = K.outerIndexPtr();
  outer[0] = 0;
  for (const int32_t count : counts) {
    for (int axis = 0; axis < 3; ++axis, ++outer) {
      outer[1] = outer[0] + 3 * count;
    }
  }
  K.resizeNonZeros(*outer);
  return K;
}

// Fills the three columns of one vertex after the other. One for each thread.
class ColumnFiller {
 public:
  ColumnFiller(const PiecewiseLinearElements& elements, const VertexCells& vertex_cells,
               BlocksOfTet blocks_of_tet, SparseMatrix* K)
      : elements_(elements),
        vertex_cells_(vertex_cells),
        blocks_of_tet_(blocks_of_tet),
        slots_(elements.num_vertices()),
        K_(*K) {}

  void Fill(Eigen::Index vertex) {
    CollectNeighbours(elements_, vertex_cells_, vertex, &neighbours_);
    blocks_.assign(neighbours_.size(), Eigen::Matrix3d::Zero());
    for (size_t slot = 0; slot < neighbours_.size(); ++slot) {
      slots_[neighbours_[slot]] = static_cast<int32_t>(slot);
    }
    TetBlocks of_tet;
    for (Eigen::Index k = vertex_cells_.begin(vertex); k < vertex_cells_.end(vertex); ++k) {
      const int32_t tet = vertex_cells_.cell(k);
      blocks_of_tet_(tet, vertex_cells_.corner(k), &of_tet);
      for (int corner = 0; corner < 4; ++corner) {
        blocks_[slots_[elements_.cells(tet, corner)]] += of_tet[static_cast<size_t>(corner)];
      }
    }
    Write(vertex);
  }

 private:
  void Write(Eigen::Index vertex) {
    for (int axis = 0; axis < 3; ++axis) {
      int32_t entry = K_.outerIndexPtr()[3 * vertex + axis];
      for (size_t slot = 0; slot < neighbours_.size(); ++slot) {
        for (int row = 0; row < 3; ++row, ++entry) {
          K_.innerIndexPtr()[entry] = 3 * neighbours_[slot] + row;
          K_.valuePtr()[entry] = blocks_[slot](row, axis);
        }
      }
    }
  }

  const PiecewiseLinearElements& elements_;
  const VertexCells& vertex_cells_;
  const BlocksOfTet blocks_of_tet_;

  std::vector<int32_t> neighbours_;
  std::vector<int32_t> slots_;  // where a vertex lies in neighbours_, if it does
  std::vector<Eigen::Matrix3d> blocks_;
  SparseMatrix& K_;
};

}  // namespace

SparseMatrix AssembleVertexBlocks(const PiecewiseLinearElements& elements,
                                  const VertexCells& vertex_cells, BlocksOfTet blocks_of_tet,
                                  int threads) {
  SparseMatrix K = LayOutColumns(elements, vertex_cells, threads);
  ParallelFor(threads, elements.num_vertices(), kVertexGrain,
              [&](Eigen::Index begin, Eigen::Index end) {
                ColumnFiller filler(elements, vertex_cells, blocks_of_tet, &K);
                for (Eigen::Index v = begin; v < end; ++v) {
                  filler.Fill(v);
                }
              });
  return K;
}

}  // namespace tissueform
