// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <Eigen/Core>

#include "core/base/types.h"
#include "core/mechanics/deformation/rotation_propagation.h"
#include "core/mesh/operators/piecewise_linear_elements.h"

namespace tissueform {

// Writes for every tet the closest rotation R of its deformation gradient F under rest +
// displacements (#V by 3) to `rotations`, resized to #C rows, and returns
//   sum_t stiffness_t |t| ||F_t - R_t||^2   [Pa mm^3].
// Neither depends on `threads`. Small energies keep their digits: F - R is formed from the
// displacements, not from positions.
//
// REQUIRES: `elements` are tets with their measures.
double FitRotations(const PiecewiseLinearElements& elements, const Eigen::VectorXd& stiffness,
                    const Positions& displacements, int threads, CellTransforms* rotations);

}  // namespace tissueform
