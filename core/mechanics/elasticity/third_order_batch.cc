// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/elasticity/third_order_batch.h"

#include "core/base/instruction_set.h"
#include "core/mechanics/elasticity/neo_hookean_expansion.h"

namespace tissueform {
namespace {

constexpr size_t kThirdOrderLanes = ThirdOrderBatch::kLanes;
constexpr size_t kThirdOrderMatrix = ThirdOrderBatch::kMatrix;

// Where pair (a, b) lies, a <= b.
inline __attribute__((always_inline)) size_t PairOf(size_t a, size_t b, size_t count) {
  return a * count - a * (a + 1) / 2 + b;
}

// P_3 of one lane. With F = I + t G + t^2 H, C = cof F and J = det F,
//   P = mu [J^(-2/3) F - J^(-5/3) |F|^2 C / 3] + K (J - 1) C,
// each factor as a polynomial in t: j = J - 1, g = J^(-2/3), s = |F|^2 - 3, m = J^(-5/3) |F|^2.
inline __attribute__((always_inline)) void ThirdOrderStress(double mu, double K,
                                                            const double (&G)[3][3],
                                                            const double (&H)[3][3],
                                                            double (&P)[3][3]) {
  double cofactors[3][3];
  double mixed_cofactors[3][3];
  double minors = 0;
  double mixed_minors = 0;
  double determinant = 0;
  double norm2 = 0;
  double product = 0;
  for (int i = 0; i < 3; ++i) {
    const int p = (i + 1) % 3, q = (i + 2) % 3;
    for (int j = 0; j < 3; ++j) {
      const int r = (j + 1) % 3, s = (j + 2) % 3;
      cofactors[i][j] = G[p][r] * G[q][s] - G[p][s] * G[q][r];
      mixed_cofactors[i][j] =
          G[p][r] * H[q][s] + H[p][r] * G[q][s] - G[p][s] * H[q][r] - H[p][s] * G[q][r];
      norm2 += G[i][j] * G[i][j];
      product += G[i][j] * H[i][j];
    }
    minors += cofactors[i][i];
    mixed_minors += mixed_cofactors[i][i];
  }
  for (int j = 0; j < 3; ++j) determinant += G[0][j] * cofactors[0][j];
  const double a1 = G[0][0] + G[1][1] + G[2][2];
  const double a2 = H[0][0] + H[1][1] + H[2][2];
  const double j1 = a1;
  const double j2 = a2 + minors;
  const double j3 = mixed_minors + determinant;
  const double j11 = j1 * j1;
  const double g1 = -2.0 / 3.0 * j1;
  const double g2 = -2.0 / 3.0 * j2 + 5.0 / 9.0 * j11;
  const double g3 = -2.0 / 3.0 * j3 + 10.0 / 9.0 * j1 * j2 - 40.0 / 81.0 * j11 * j1;
  const double h1 = -5.0 / 3.0 * j1;
  const double h2 = -5.0 / 3.0 * j2 + 20.0 / 9.0 * j11;
  const double h3 = -5.0 / 3.0 * j3 + 40.0 / 9.0 * j1 * j2 - 220.0 / 81.0 * j11 * j1;
  const double s1 = 2.0 * a1;
  const double s2 = 2.0 * a2 + norm2;
  const double s3 = 2.0 * product;
  const double m1 = 3.0 * h1 + s1;
  const double m2 = 3.0 * h2 + h1 * s1 + s2;
  const double m3 = 3.0 * h3 + h2 * s1 + h1 * s2 + s3;
  // What C_3, C_2 = a2 I - H^T + cof G, C_1 = a1 I - G^T and I are multiplied with.
  const double of_c3 = -mu;
  const double of_c2 = K * j1 - mu * m1 / 3.0;
  const double of_c1 = K * j2 - mu * m2 / 3.0;
  const double of_unit = mu * g3 + K * j3 - mu * m3 / 3.0 + of_c2 * a2 + of_c1 * a1;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      P[i][j] = mu * (g1 * H[i][j] + g2 * G[i][j]) + of_c3 * mixed_cofactors[i][j] +
                of_c2 * (cofactors[i][j] - H[j][i]) - of_c1 * G[j][i];
    }
    P[i][i] += of_unit;
  }
}

// One direction n = e_a + e_b + e_c: v(n) and w(n), where every pair of the three counts.
inline __attribute__((always_inline)) void EvaluateDirection(double shear, double bulk,
                                                             const ThirdOrderBatch& batch,
                                                             const size_t (&n)[3],
                                                             double* __restrict loads) {
  const double* v[3];
  const double* w[6];
  for (size_t i = 0; i < 3; ++i) {
    v[i] = batch.first.data() + n[i] * kThirdOrderMatrix;
    w[i] = batch.second.data() + PairOf(n[i], n[i], batch.num_fields) * kThirdOrderMatrix;
    const size_t low = i == 2 ? 1 : 0;
    const size_t high = i == 0 ? 1 : 2;
    w[3 + i] = batch.second.data() + PairOf(n[low], n[high], batch.num_fields) * kThirdOrderMatrix;
  }
  const double* const hats = batch.hats.data();
  for (size_t k = 0; k < kThirdOrderLanes; ++k) {
    double G[3][3];
    double H[3][3];
    for (size_t i = 0; i < 3; ++i) {
      for (size_t j = 0; j < 3; ++j) {
        const size_t at = (3 * i + j) * kThirdOrderLanes + k;
        G[i][j] = v[0][at] + v[1][at] + v[2][at];
        H[i][j] = w[0][at] + w[1][at] + w[2][at] + 2.0 * (w[3][at] + w[4][at] + w[5][at]);
      }
    }
    double P[3][3];
    ThirdOrderStress(shear, bulk, G, H, P);
    for (size_t a = 0; a < 3; ++a) {
      const double* const hat = hats + 3 * a * kThirdOrderLanes + k;
      for (size_t i = 0; i < 3; ++i) {
        loads[(3 * a + i) * kThirdOrderLanes + k] = P[i][0] * hat[0] +
                                                    P[i][1] * hat[kThirdOrderLanes] +
                                                    P[i][2] * hat[2 * kThirdOrderLanes];
      }
    }
  }
}

inline __attribute__((always_inline)) void EvaluateDirections(double shear, double bulk,
                                                              ThirdOrderBatch* batch) {
  double* loads = batch->loads.data();
  for (size_t a = 0; a < batch->num_fields; ++a) {
    for (size_t b = a; b < batch->num_fields; ++b) {
      for (size_t c = b; c < batch->num_fields; ++c, loads += kThirdOrderMatrix) {
        EvaluateDirection(shear, bulk, *batch, {a, b, c}, loads);
      }
    }
  }
}

TISSUEFORM_TARGET_AVX512 void ThirdOrderAvx512(double shear, double bulk, ThirdOrderBatch* batch) {
  EvaluateDirections(shear, bulk, batch);
}
TISSUEFORM_TARGET_AVX2 void ThirdOrderAvx2(double shear, double bulk, ThirdOrderBatch* batch) {
  EvaluateDirections(shear, bulk, batch);
}
void ThirdOrderBaseline(double shear, double bulk, ThirdOrderBatch* batch) {
  EvaluateDirections(shear, bulk, batch);
}

constexpr KernelVersions<void(double, double, ThirdOrderBatch*)> kThirdOrder{
    ThirdOrderBaseline, ThirdOrderAvx2, ThirdOrderAvx512};

}  // namespace

ThirdOrderBatch::ThirdOrderBatch(size_t count)
    : num_fields(count),
      first(count * kThirdOrderMatrix),
      second(static_cast<size_t>(NumFieldPairs(static_cast<Eigen::Index>(count))) *
             kThirdOrderMatrix),
      hats(kThirdOrderMatrix),
      loads(static_cast<size_t>(NumFieldTriples(static_cast<Eigen::Index>(count))) *
            kThirdOrderMatrix) {}

void EvaluateThirdOrder(double shear, double bulk, ThirdOrderBatch* batch) {
  kThirdOrder.Active()(shear, bulk, batch);
}

}  // namespace tissueform
