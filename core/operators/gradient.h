// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/base/types.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

// Gradients of the four hat functions of every tet, #T by 12: row t is [grad phi_0, ..., grad
// phi_3], three numbers each, in 1/mm. From (Liao et al. 2009, section 3.1, the equation above Eq.
// 4): the first three are the columns of the inverse of the matrix with rows v_a - v_3; the last is
// minus their sum.
//
// REQUIRES: every tet has positive volume (see ValidateTetMesh).
using HatGradientMatrix = Eigen::Matrix<double, Eigen::Dynamic, 12, Eigen::RowMajor>;
HatGradientMatrix HatGradients(const TetMesh& mesh);

// Gradient operator of piecewise-linear functions (Liao et al. 2009, Eq. 4).
//
// Returns G, 3*#T by #V: for f with one value per vertex, rows 3t..3t+2 of G*f are the constant
// gradient (x, y, z) [unit of f per mm] inside tet t. Exact for linear f; constants lie in its null
// space.
//
// REQUIRES: every tet has positive volume.
SparseMatrix Gradient(const TetMesh& mesh);

}  // namespace tissueform
