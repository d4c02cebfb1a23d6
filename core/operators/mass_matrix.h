// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/base/types.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

// "Mass" matrix of piecewise-constant vector fields (Liao et al. 2009, section 3.1 for M,
// section 3.3 for M').
//
// Returns M', 3*#T by 3*#T, diagonal, positive: rows 3t..3t+2 hold stiffness(t) * |T_t| [Pa mm^3].
// With a stiffness of one everywhere it is M.
//
// REQUIRES: stiffness has #T positive entries; every tet has positive volume.
SparseMatrix MassMatrix(const TetMesh& mesh, const Eigen::VectorXd& stiffness);

}  // namespace tissueform
