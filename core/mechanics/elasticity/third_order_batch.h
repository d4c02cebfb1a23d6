// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <vector>

namespace tissueform {

// The third order of the forces of several tets at once, laid out as NeoHookeanBatch: number k of
// every lane lies beside that of the next tet, so that one instruction works on several.
//
// With fields v_a and w_ab (a <= b) the displacements t v(n) + t^2 w(n), v(n) = sum n_a v_a and
// w(n) = sum n_a n_b w_ab over all a and b, pull at a tet with P_3(n) t^3 beside lower orders: a
// cubic in n. It is evaluated at the directions n = e_a + e_b + e_c, a <= b <= c, which determine
// it.
struct ThirdOrderBatch {
  static constexpr size_t kLanes = 8;
  static constexpr size_t kMatrix = 9 * kLanes;  // numbers of a matrix: row-major, lanes fastest

  explicit ThirdOrderBatch(size_t num_fields);

  size_t num_fields;
  // In: displacement gradients of the v_a and, pair by pair in their order, of the w_ab.
  std::vector<double> first;
  std::vector<double> second;
  std::vector<double> hats;  // rows 0 to 2: gradients of the hat functions of corners 1 to 3
  // Out: for every direction, in the order (0, 0, 0), (0, 0, 1), ..., (0, 1, 1), ..., P_3 times the
  // gradients of corners 1 to 3: coordinate i of corner a at 3 (a - 1) + i.
  std::vector<double> loads;
};

// By the law of NeoHookeanEnergy. `shear` and `bulk` are the moduli of all lanes: those of a unit
// Young's modulus, when `hats` hold the tets' stiffness times volume.
void EvaluateThirdOrder(double shear, double bulk, ThirdOrderBatch* batch);

}  // namespace tissueform
