// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/base/types.h"
#include "core/mesh/operators/piecewise_linear_elements.h"
#include "core/mesh/vertex_cells.h"

namespace tissueform {

// Stiffness matrix of linear elasticity on constant-strain tets.
//
// Returns K, 3 #V by 3 #V, in Pa mm, unknowns interleaved (3 v + axis), so that K d is the force in
// Pa mm^2 that holds the displacements d in mm. The block of vertices a and b is
//   K_ab = sum over tets t holding both of
//          |t| (lambda_t g_a g_b^T + mu_t g_b g_a^T + mu_t (g_a . g_b) I)
// with g_a the gradient of the hat function of a and lambda_t, mu_t of Young's modulus
// `stiffness(t)` in Pa and one Poisson's ratio. Symmetric to the bit, both triangles stored,
// positive semi-definite; each connected component adds its six rigid motions to the null space.
// Rows of vertices that no tet holds are empty. The result does not depend on `threads`.
//
// REQUIRES: tets of positive volume with their measures; `vertex_cells` of these elements; one
// positive stiffness a tet; CheckPoissonRatio is OK; fewer than 2^31 entries (some 15 million
// vertices).
SparseMatrix ElasticStiffness(const PiecewiseLinearElements& elements,
                              const VertexCells& vertex_cells, const Eigen::VectorXd& stiffness,
                              double poisson_ratio, int threads);

}  // namespace tissueform
