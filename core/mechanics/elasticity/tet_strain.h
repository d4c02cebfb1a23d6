// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/base/types.h"
#include "core/mesh/operators/piecewise_linear_elements.h"

namespace tissueform {

// Displacement gradient H = d(x - v)/dv = F - I of a tet under `positions`, #V by 3: constant
// inside, zero at rest, with the digits of small displacements.
Eigen::Matrix3d TetDisplacementGradient(const PiecewiseLinearElements& elements,
                                        const Positions& positions, Eigen::Index tet);

// Deformation gradient F = dx/dv, the identity at rest.
Eigen::Matrix3d TetDeformationGradient(const PiecewiseLinearElements& elements,
                                       const Positions& positions, Eigen::Index tet);

// Principal values of the Green-Lagrange strain (F^T F - I) / 2, #T by 3, the largest first.
// Turning or moving the whole body changes nothing, and a rigid motion gives zero; a stretch by s
// gives e = (s^2 - 1) / 2 along it. Of the same axes, ln(1 + 2 e) / 2 is the logarithmic strain.
// The result does not depend on `threads`.
using PrincipalValues = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
PrincipalValues PrincipalGreenStrains(const PiecewiseLinearElements& elements,
                                      const Positions& positions, int threads);

}  // namespace tissueform
