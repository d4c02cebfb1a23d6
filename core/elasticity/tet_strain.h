// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/base/types.h"
#include "core/operators/piecewise_linear_elements.h"

namespace tissueform {

// Deformation gradient F = dx/dv of a tet under `positions`, #V by 3: constant inside, the identity
// at rest.
Eigen::Matrix3d TetDeformationGradient(const PiecewiseLinearElements& elements,
                                       const Positions& positions, Eigen::Index tet);

// Principal values of the Green-Lagrange strain (F^T F - I) / 2, #T by 3, the largest first.
// Turning or moving the whole body changes nothing, and a rigid motion gives zero; a stretch by s
// gives (s^2 - 1) / 2 along it. The result does not depend on `threads`.
using PrincipalValues = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
PrincipalValues PrincipalGreenStrains(const PiecewiseLinearElements& elements,
                                      const Positions& positions, int threads);

// Von Mises stress of the linear model, #T, in Pa: of sigma = lambda tr(e) I + 2 mu e with the
// small strain e = (F + F^T) / 2 - I. Only as good as the model: a large rotation shows as stress.
//
// REQUIRES: `stiffness` has one entry a tet, in Pa; CheckPoissonRatio is OK.
Eigen::VectorXd LinearVonMisesStress(const PiecewiseLinearElements& elements,
                                     const Positions& positions, const Eigen::VectorXd& stiffness,
                                     double poisson_ratio, int threads);

}  // namespace tissueform
