// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <Eigen/Core>

#include "core/mesh/operators/piecewise_linear_elements.h"

namespace tissueform {

// Pairs (a, b) with a <= b of so many fields, as they are counted below: (0, 0), (0, 1), ...,
// (1, 1), ...
constexpr Eigen::Index NumFieldPairs(Eigen::Index fields) { return fields * (fields + 1) / 2; }
// Triples (a, b, c) with a <= b <= c, counted likewise: the last one fastest.
constexpr Eigen::Index NumFieldTriples(Eigen::Index fields) {
  return fields * (fields + 1) * (fields + 2) / 6;
}

// n_a n_b n_c for all of those, times the number of orders of the three: 1, 3 or 6.
Eigen::VectorXd TripleProducts(const Eigen::VectorXd& numbers);

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

// The third order of the same forces along a curve: for n of #fields numbers, with
//   v(n) = sum_a n_a v_a,   w(n) = sum_(a, b) n_a n_b w_ab (a, b over all, w_ba = w_ab),
// f(t v(n) + t^2 w(n)) = t K v + t^2 (K w + Q(v, v)) + t^3 p(n) + O(t^4). Returns the columns of
// the cubic p: p(n) = sum over a <= b <= c of n_a n_b n_c m p_abc, m = 1, 3 or 6 the number of
// orders of the three. `first` is 3 #V by #fields, the v_a; `second` 3 #V by NumFieldPairs, the
// w_ab; returned are 3 #V by NumFieldTriples.
//
// REQUIRES: as NeoHookeanEnergy; at least one tet.
Eigen::MatrixXd ThirdOrderForces(const PiecewiseLinearElements& elements,
                                 const Eigen::VectorXd& stiffness, double poisson_ratio,
                                 const Eigen::MatrixXd& first, const Eigen::MatrixXd& second);

}  // namespace tissueform
