// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <cstdint>

#include "absl/functional/function_ref.h"

#include "core/base/types.h"
#include "core/mesh/operators/piecewise_linear_elements.h"
#include "core/mesh/vertex_cells.h"

namespace tissueform {

// What a tet adds to the blocks of one of its corners with all four of them, itself among them.
using TetBlocks = std::array<Eigen::Matrix3d, 4>;

// Puts the blocks of corner `own` with every corner of tet `tet` into `blocks`. Called by several
// threads at once.
using BlocksOfTet = absl::FunctionRef<void(int32_t tet, int own, TetBlocks* blocks)>;

// The sum over all tets of what couples their corners: 3 #V by 3 #V, unknowns interleaved (3 v +
// axis), both triangles stored, the same pattern for every matrix of these elements. The block with
// corner b lies in the columns of the own corner, so `blocks` holds K_ba (transposed K_ab). Rows of
// vertices that no tet holds are empty. The result does not depend on `threads`.
//
// REQUIRES: `vertex_cells` of these elements; fewer than 2^31 entries (some 15 million vertices).
SparseMatrix AssembleVertexBlocks(const PiecewiseLinearElements& elements,
                                  const VertexCells& vertex_cells, BlocksOfTet blocks_of_tet,
                                  int threads);

}  // namespace tissueform
