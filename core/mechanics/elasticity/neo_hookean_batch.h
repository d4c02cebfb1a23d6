// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

namespace tissueform {

// Many tets at once, laid out so that the compiler works on several in one instruction. Which
// instructions (AVX-512, AVX2 or the baseline) is chosen once at run time, so one program runs
// everywhere.
struct NeoHookeanBatch {
  static constexpr int kSize = 64;

  // In. Coordinate i of the edge from corner 0 to corner a lies at [3 * (a - 1) + i][k].
  alignas(64) double rest_edges[9][kSize];          // mm; of positive volume
  alignas(64) double displacement_edges[9][kSize];  // mm: displacement at a less that at corner 0
  alignas(64) double stiffness[kSize];              // Young's modulus, Pa

  // Out.
  alignas(64) double energy[kSize];         // nJ; means nothing where a tet is inverted
  alignas(64) double volume_change[kSize];  // J - 1
  // The energy's derivatives, in Pa mm^2, by the displacements of corners 1 to 3, laid out as the
  // edges are; that of corner 0 is minus their sum.
  alignas(64) double loads[9][kSize];
};

// Evaluates the law of NeoHookeanEnergy. `unit_shear` and `unit_bulk` are the moduli for a Young's
// modulus of one. Every lane must hold a tet.
void EvaluateNeoHookean(double unit_shear, double unit_bulk, NeoHookeanBatch* batch);

}  // namespace tissueform
