// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>

#include "core/base/types.h"
#include "core/mesh/operators/piecewise_linear_elements.h"
#include "core/mesh/vertex_cells.h"

namespace tissueform {

enum class TangentForm {
  kTrue,      // the second derivatives of the energy; indefinite where tissue may buckle
  kPositive,  // of every tet the nearest one without negative eigenvalues
};

// Second derivatives of NeoHookeanEnergy by the displacements, 3 #V by 3 #V, in Pa mm, unknowns
// interleaved (3 v + axis), both triangles stored and equal up to rounding; the pattern is that of
// ElasticStiffness for the same elements, and at rest so are the numbers. The result does not
// depend on `threads`.
//
// kPositive sets the negative eigenvalues of each tet's second derivatives by its deformation
// gradient to zero (Teran, Sifakis, Irving, Fedkiw 2005), which are known in closed form but for a
// symmetric 3 by 3 matrix (Smith, de Goes, Kim 2019): positive semi-definite, and the true one
// wherever no tet has a negative one.
//
// REQUIRES: as NeoHookeanEnergy; under `displacements` (#V by 3, mm) every tet has positive volume.
SparseMatrix NeoHookeanTangent(const PiecewiseLinearElements& elements,
                               const VertexCells& vertex_cells, const Eigen::VectorXd& stiffness,
                               double poisson_ratio, const Positions& displacements,
                               TangentForm form, int threads);

// The memory that computing a tangent takes in addition to the matrix itself.
int64_t NeoHookeanTangentWorkspaceBytes(Eigen::Index num_tets);

}  // namespace tissueform
