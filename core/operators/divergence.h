// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/base/types.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

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
