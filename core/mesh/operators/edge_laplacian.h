// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>

#include "core/base/types.h"
#include "core/mesh/vertex_cells.h"

namespace tissueform {

// Local end points of the three edges of a triangle; edge k is opposite to corner k.
inline constexpr std::array<std::array<int, 2>, 3> kTriangleEdges = {{{1, 2}, {2, 0}, {0, 1}}};

// Sums weights of cell edges to a Laplacian: L_ij = -w_ij, L_ii = sum_j w_ij with w_ij the sum over
// cells holding edge ij. `edge_weights` is #C by 6, in the order of kTetEdges, for tets and #C by
// 3, in the order of kTriangleEdges, for triangles. Symmetric to the bit, both triangles stored;
// rows of vertices without cells are empty. The result does not depend on the number of threads.
using CellEdgeWeights = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
SparseMatrix AssembleEdgeLaplacian(const Eigen::Ref<const CellIndices>& cells,
                                   Eigen::Index num_vertices,
                                   const Eigen::Ref<const CellEdgeWeights>& edge_weights,
                                   int threads);

// Laplacian with weight one on every edge of the cells, of any length and angles: the uniform
// guidance that the source compares with (Liao et al. 2009, Fig. 6b and d).
SparseMatrix UniformLaplacian(const Eigen::Ref<const CellIndices>& cells, Eigen::Index num_vertices,
                              int threads);

// Number of edges whose weight -L_ij is negative: where there are some, the maximum principle is
// lost and harmonic fields may leave [0, 1].
Eigen::Index CountNegativeWeights(const SparseMatrix& L);

}  // namespace tissueform
