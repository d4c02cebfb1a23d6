// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// This file alone is compiled with -ffast-math, which lets the compiler use the C library's vector
// logarithm and exponential. Nothing in here judges NaN or infinity: volumes are floored before the
// logarithm, and the caller looks at the volume changes.

#include "core/mechanics/elasticity/neo_hookean_batch.h"

#include <cmath>

#include "core/base/instruction_set.h"

namespace tissueform {
namespace {

constexpr int kSize = NeoHookeanBatch::kSize;
// Keeps the logarithm of an inverted tet finite.
constexpr double kSmallestVolumeChange = -1.0 + 1e-9;

// In terms of the displacement gradient H = F - I, so that small displacements keep their digits:
//   J - 1 = tr H + (second minors of H) + det H,   I1 - 3 = 2 tr H + |H|^2,
//   W = mu/2 ((J^(-2/3) - 1) I1 + (I1 - 3)) + K/2 (J - 1)^2,
//   P = dW/dF = mu J^(-2/3) F + (K (J - 1) - mu J^(-2/3) I1 / (3 J)) cof F.
inline __attribute__((always_inline)) void EvaluateBody(double unit_shear, double unit_bulk,
                                                        NeoHookeanBatch* batch) {
  const auto& e = batch->rest_edges;
  const auto& d = batch->displacement_edges;
  for (int k = 0; k < kSize; ++k) {
    const double a0 = e[0][k], a1 = e[1][k], a2 = e[2][k];
    const double b0 = e[3][k], b1 = e[4][k], b2 = e[5][k];
    const double c0 = e[6][k], c1 = e[7][k], c2 = e[8][k];
    const double bc0 = b1 * c2 - b2 * c1, bc1 = b2 * c0 - b0 * c2, bc2 = b0 * c1 - b1 * c0;
    const double ca0 = c1 * a2 - c2 * a1, ca1 = c2 * a0 - c0 * a2, ca2 = c0 * a1 - c1 * a0;
    const double ab0 = a1 * b2 - a2 * b1, ab1 = a2 * b0 - a0 * b2, ab2 = a0 * b1 - a1 * b0;
    const double six_volumes = a0 * bc0 + a1 * bc1 + a2 * bc2;
    const double inverse = 1.0 / six_volumes;
    // Gradients of the hat functions of corners 1 to 3.
    const double g[3][3] = {{bc0 * inverse, bc1 * inverse, bc2 * inverse},
                            {ca0 * inverse, ca1 * inverse, ca2 * inverse},
                            {ab0 * inverse, ab1 * inverse, ab2 * inverse}};
    double H[3][3];
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        H[i][j] = d[i][k] * g[0][j] + d[3 + i][k] * g[1][j] + d[6 + i][k] * g[2][j];
      }
    }
    const double trace = H[0][0] + H[1][1] + H[2][2];
    // Cofactors of H; the second minors are their trace.
    double M[3][3];
    for (int i = 0; i < 3; ++i) {
      const int p = (i + 1) % 3, q = (i + 2) % 3;
      for (int j = 0; j < 3; ++j) {
        const int r = (j + 1) % 3, s = (j + 2) % 3;
        M[i][j] = H[p][r] * H[q][s] - H[p][s] * H[q][r];
      }
    }
    const double determinant = H[0][0] * M[0][0] + H[0][1] * M[0][1] + H[0][2] * M[0][2];
    const double volume_change = trace + (M[0][0] + M[1][1] + M[2][2]) + determinant;
    double norm2 = 0;
    for (int i = 0; i < 3; ++i) {
      norm2 += H[i][0] * H[i][0] + H[i][1] * H[i][1] + H[i][2] * H[i][2];
    }
    const double stretch = 2.0 * trace + norm2;  // I1 - 3
    const double safe_change =
        volume_change > kSmallestVolumeChange ? volume_change : kSmallestVolumeChange;
    const double power_change = std::expm1(-2.0 / 3.0 * std::log1p(safe_change));  // J^(-2/3) - 1
    const double shear = unit_shear * (1.0 + power_change);
    const double pressure =
        unit_bulk * safe_change - shear * (3.0 + stretch) / (3.0 * (1.0 + safe_change));
    const double weight = batch->stiffness[k] * six_volumes / 6.0;
    batch->volume_change[k] = volume_change;
    batch->energy[k] = 0.5 * weight *
                       (unit_shear * (power_change * (3.0 + stretch) + stretch) +
                        unit_bulk * safe_change * safe_change);

    // cof F = I + (tr H) I - H^T + cof H.
    double P[3][3];
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        const double own = i == j ? 1.0 : 0.0;
        const double cofactor = own * (1.0 + trace) - H[j][i] + M[i][j];
        P[i][j] = weight * (shear * (own + H[i][j]) + pressure * cofactor);
      }
    }
    for (int a = 0; a < 3; ++a) {
      for (int i = 0; i < 3; ++i) {
        batch->loads[3 * a + i][k] = P[i][0] * g[a][0] + P[i][1] * g[a][1] + P[i][2] * g[a][2];
      }
    }
  }
}

TISSUEFORM_TARGET_AVX512 void EvaluateAvx512(double unit_shear, double unit_bulk,
                                             NeoHookeanBatch* batch) {
  EvaluateBody(unit_shear, unit_bulk, batch);
}
TISSUEFORM_TARGET_AVX2 void EvaluateAvx2(double unit_shear, double unit_bulk,
                                         NeoHookeanBatch* batch) {
  EvaluateBody(unit_shear, unit_bulk, batch);
}
void EvaluateBaseline(double unit_shear, double unit_bulk, NeoHookeanBatch* batch) {
  EvaluateBody(unit_shear, unit_bulk, batch);
}

constexpr KernelVersions<void(double, double, NeoHookeanBatch*)> kEvaluate{
    EvaluateBaseline, EvaluateAvx2, EvaluateAvx512};

}  // namespace

void EvaluateNeoHookean(double unit_shear, double unit_bulk, NeoHookeanBatch* batch) {
  kEvaluate.Active()(unit_shear, unit_bulk, batch);
}

}  // namespace tissueform
