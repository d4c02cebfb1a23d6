// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <Eigen/Core>

#include "core/operators/piecewise_linear_elements.h"

namespace tissueform {

// Pairs (a, b) with a <= b of so many fields, as they are counted below: (0, 0), (0, 1), ...,
// (1, 1), ...
constexpr Eigen::Index NumFieldPairs(Eigen::Index fields) { return fields * (fields + 1) / 2; }

// The forces of a neo-Hookean body (NeoHookeanEnergy), expanded about rest:
//   f(u) = K u + Q(u, u) + O(|u|^3),
// K the stiffness of linear elasticity and Q bilinear and symmetric. Returns Q(fields_a, fields_b),
// 3 #V by NumFieldPairs, in Pa mm^2 for fields in mm; `fields` is 3 #V by #fields. Unknowns are
// interleaved: 3 v + axis.
//
// REQUIRES: as NeoHookeanEnergy.
Eigen::MatrixXd SecondOrderForces(const PiecewiseLinearElements& elements,
                                  const Eigen::VectorXd& stiffness, double poisson_ratio,
                                  const Eigen::MatrixXd& fields);

}  // namespace tissueform
