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

// "Mass" matrix of piecewise-constant vector fields (Liao et al. 2009, section 3.1 for M,
// section 3.3 for M').
//
// Returns M', 3*#T by 3*#T, diagonal, positive: rows 3t..3t+2 hold stiffness(t) * |T_t| [Pa mm^3].
// With a stiffness of one everywhere it is M.
//
// REQUIRES: stiffness has #T positive entries; every tet has positive volume.
SparseMatrix MassMatrix(const TetMesh& mesh, const Eigen::VectorXd& stiffness);

// Integrated divergence of piecewise-constant vector fields, G^T M' (Liao et al. 2009,
// section 3.1).
//
// Returns D, #V by 3*#T: for w with rows 3t..3t+2 the vector in tet t,
// (D w)_i = sum over tets t holding i of stiffness(t) |T_t| grad phi_i . w_t. This is the source's
// sign: minus the usual divergence of the interior, so that D * Gradient = +Laplacian (positive
// semi-definite). Its columns sum to zero.
//
// REQUIRES: stiffness has #T positive entries; every tet has positive volume.
SparseMatrix Divergence(const TetMesh& mesh, const Eigen::VectorXd& stiffness);

}  // namespace tissueform
