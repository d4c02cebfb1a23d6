// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/base/types.h"
#include "core/mechanics/deformation/harmonic_fields.h"
#include "core/mechanics/deformation/rotation_propagation.h"
#include "core/mesh/operators/piecewise_linear_elements.h"

namespace tissueform {

// How far the estimated rotation of a cell takes the place of the propagated one.
enum class BlendMap {
  kCosine,     // cos(pi (u - 1/2)); the source's choice
  kLinear,     // 2 (1 - u)
  kUnblended,  // 1 everywhere: the update that the source shows not to work (Fig. 3b)
};

// Weight h of every cell, #C, in [0, 1]: the map of u = max(u_F, u_1, ..., u_k) at the barycentre,
// clamped (Liao et al. 2009, section 3.2; for one handle these are the source's 1 - 2|s - 1/2| and
// cos(pi |s - 1/2|)). `harmonic` is #C by #handles.
Eigen::VectorXd BlendWeights(const CellField& harmonic, BlendMap map);

// The local step of the `estimated` mode: for every cell the closest rotation R of its deformation
// gradient under `positions` (#V by 3), blended with the propagated transform P of the same cell:
//   P exp(h log(P^-1 R)),   and with P = s Q (scale and rotation)   s^(1-h) Q exp(h log(Q^T R)).
// The deformation gradient of a triangle is completed by its unit normals.
//
// `propagated` has #C rows or none, which stands for the identity. `transforms` is resized to
// #C rows and may be used again and again, which saves mapping fresh memory in every iteration. The
// result does not depend on `threads`.
void EstimateRotations(const PiecewiseLinearElements& elements, const Positions& positions,
                       const Eigen::VectorXd& weights, const CellTransforms& propagated,
                       int threads, CellTransforms* transforms);

}  // namespace tissueform
