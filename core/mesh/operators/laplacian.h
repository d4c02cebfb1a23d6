// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/base/types.h"
#include "core/mesh/tet_mesh.h"
#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// Cotangent weights of every tet, #T by 6, column e for edge e of kTetEdges, in mm:
//   w_e = 1/6 * l_opp * cot(theta_opp)
// with the length of the opposite edge and the dihedral angle at it (Liao et al. 2009, Eq. 3,
// Appendix A). Negative where the dihedral angle is obtuse.
//
// REQUIRES: every tet has positive volume.
using TetCotangentWeights = Eigen::Matrix<double, Eigen::Dynamic, 6, Eigen::RowMajor>;
TetCotangentWeights CotangentWeights(const TetMesh& mesh, int threads = 1);

// Cotangent weights of every triangle, #F by 3, column k for the edge opposite to corner k, no
// unit:
//   w_k = 1/2 * cot(angle at corner k)   (Liao et al. 2009, Eq. 13).
//
// REQUIRES: every triangle has positive area.
using TriangleCotangentWeights = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
TriangleCotangentWeights CotangentWeights(const TriangleMesh& mesh, int threads = 1);

// Stiffness-weighted cotangent Laplacian (Liao et al. 2009, Eq. 11 for tets, Eq. 13 for triangles).
//
// Returns L, #V by #V, symmetric positive semi-definite, both triangles stored, in Pa mm (tets) or
// Pa (triangles):
//   L_ij = -w_ij,   L_ii = sum_j w_ij,   w_ij = sum over cells c holding edge ij of stiffness(c) *
//   w_e(c).
// The source's Eq. (5) prints the opposite sign, which contradicts its Eqs. (3), (6) and Appendix
// A. Equals G^T M' G to rounding. Constants lie in its null space. Rows of vertices that no cell
// holds are empty. The result does not depend on the number of threads.
//
// REQUIRES: stiffness has one positive entry per cell; every cell has positive volume or area.
SparseMatrix CotangentLaplacian(const TetMesh& mesh, const Eigen::VectorXd& stiffness,
                                int threads = 1);
SparseMatrix CotangentLaplacian(const TriangleMesh& mesh, const Eigen::VectorXd& stiffness,
                                int threads = 1);

}  // namespace tissueform
