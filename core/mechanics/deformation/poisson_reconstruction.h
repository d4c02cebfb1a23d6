// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/base/types.h"
#include "core/mechanics/deformation/rotation_propagation.h"
#include "core/mesh/operators/piecewise_linear_elements.h"
#include "core/mesh/vertex_cells.h"

namespace tissueform {

// The right-hand side of the Poisson reconstruction (Liao et al. 2009, Eqs. 9 and 12), written for
// displacements: with x' = v + d and L v = G^T M' grad v,
//   L d = G^T M' ((P - I) grad v),   so   b_i = sum over cells c holding i of w_c (P_c - I) grad
//   phi_i
// with w_c = stiffness(c) |c|, |c| the volume of a tet or the area of a triangle. Same solution as
// the source's equation, but an identity pose gives exactly the rest shape and digits are not lost
// to the coordinates' own size.
//
// Found in two steps, cells first: a vertex then reads three numbers of a cell, not its whole
// transform.

// Loads w_c (P_c - I) grad phi of a cell's corners 1, 2 and 3 in a row of nine (zero where a
// triangle has no such corner); corner 0 bears minus their sum. In the memory of the transforms,
// the largest array that an answer needs.
using CornerLoads = CellTransforms;

// Makes corner loads of the transforms P, #C rows or none, which stands for the identity and for no
// load. `stiffness` is #C.
void TransformsToCornerLoads(const PiecewiseLinearElements& elements,
                             const Eigen::VectorXd& stiffness, int threads,
                             CellTransforms* transforms);

// b, #V by 3, or no rows, which stands for zero. Gathered vertex by vertex, so the result does not
// depend on `threads`.
Eigen::MatrixXd GatherCornerLoads(const VertexCells& vertex_cells, Eigen::Index num_vertices,
                                  const CornerLoads& loads, int threads);

}  // namespace tissueform
