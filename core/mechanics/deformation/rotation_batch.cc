// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// This file alone is compiled with -ffast-math, which lets the compiler use the C library's vector
// sine, cosine and arctangent. Nothing in here meets NaN or infinity: callers pass finite matrices,
// and lanes that would divide by zero are kept away from it with a floor.

#include <cmath>

#include "core/base/instruction_set.h"
#include "core/mechanics/deformation/closest_rotation.h"

namespace tissueform {
namespace {

constexpr int kSize = RotationBatch::kSize;

// Largest number of Newton steps. From a condition number of 1e8 nine are needed (Higham 1986).
constexpr int kMaxNewtonSteps = 16;
// The iteration converges quadratically: after a step of 3e-8 (on entries of size one) the next one
// would be below rounding.
constexpr double kSquaredStepTolerance = 1e-15;
// Once steps are this small Higham's scaling no longer helps; its roots and divisions are saved.
constexpr double kSquaredStepToStopScaling = 1e-2;
// det F against ||F||^3 below which the sign of the determinant is not trusted.
constexpr double kSmallestRelativeDeterminant = 1e-9;
constexpr double kFloor = 1e-300;

// det X from its entries m[9][lane].
inline __attribute__((always_inline)) double Determinant(const double m[9][kSize], int k) {
  return m[0][k] * (m[4][k] * m[8][k] - m[5][k] * m[7][k]) +
         m[1][k] * (m[5][k] * m[6][k] - m[3][k] * m[8][k]) +
         m[2][k] * (m[3][k] * m[7][k] - m[4][k] * m[6][k]);
}

// X <- (gamma X + X^-T / gamma) / 2 in every lane, with Higham's gamma^2 = ||X^-1|| / ||X||
// (Frobenius) or one. Returns the largest squared step. One loop, so that a lane's nine entries
// stay in registers.
template <bool kScaled>
inline __attribute__((always_inline)) double NewtonStep(double m[9][kSize]) {
  alignas(64) double step2[kSize];
  for (int k = 0; k < kSize; ++k) {
    const double a = m[0][k], b = m[1][k], c = m[2][k];
    const double d = m[3][k], e = m[4][k], f = m[5][k];
    const double g = m[6][k], h = m[7][k], i = m[8][k];
    // Cofactors: X^-T = cofactors / det.
    const double A = e * i - f * h, B = f * g - d * i, C = d * h - e * g;
    const double D = c * h - b * i, E = a * i - c * g, F = b * g - a * h;
    const double G = b * f - c * e, H = c * d - a * f, I = a * e - b * d;
    const double inverse_det = 1.0 / (a * A + b * B + c * C);
    double own = 0.5;
    double other = 0.5 * inverse_det;
    if constexpr (kScaled) {
      const double norm2 = a * a + b * b + c * c + d * d + e * e + f * f + g * g + h * h + i * i;
      const double cofactor_norm2 =
          A * A + B * B + C * C + D * D + E * E + F * F + G * G + H * H + I * I;
      const double gamma = std::sqrt(std::sqrt(cofactor_norm2 / norm2) * inverse_det);
      own *= gamma;
      other /= gamma;
    }
    const double next[9] = {own * a + other * A, own * b + other * B, own * c + other * C,
                            own * d + other * D, own * e + other * E, own * f + other * F,
                            own * g + other * G, own * h + other * H, own * i + other * I};
    const double old[9] = {a, b, c, d, e, f, g, h, i};
    double sum = 0;
    for (int entry = 0; entry < 9; ++entry) {
      const double step = next[entry] - old[entry];
      sum += step * step;
      m[entry][k] = next[entry];
    }
    step2[k] = sum;
  }
  double largest = 0;
  for (int k = 0; k < kSize; ++k) {
    largest = step2[k] > largest ? step2[k] : largest;
  }
  return largest;
}

inline __attribute__((always_inline)) void ClosestRotationsBody(RotationBatch* batch) {
  alignas(64) double X[9][kSize];
  double* reliable = batch->reliable;
  for (int k = 0; k < kSize; ++k) {
    double norm2 = 0;
    for (int entry = 0; entry < 9; ++entry) {
      norm2 += batch->matrix[entry][k] * batch->matrix[entry][k];
    }
    const double smallest = kSmallestRelativeDeterminant * norm2 * std::sqrt(norm2) + kFloor;
    reliable[k] = Determinant(batch->matrix, k) > smallest ? 1.0 : 0.0;
  }
  // Lanes that cannot converge iterate on the identity.
  for (int entry = 0; entry < 9; ++entry) {
    const double identity = entry % 4 == 0 ? 1.0 : 0.0;
    for (int k = 0; k < kSize; ++k) {
      X[entry][k] = reliable[k] != 0.0 ? batch->matrix[entry][k] : identity;
    }
  }
  double largest_step2 = 1;
  for (int step = 0; step < kMaxNewtonSteps && largest_step2 > kSquaredStepTolerance; ++step) {
    largest_step2 =
        largest_step2 > kSquaredStepToStopScaling ? NewtonStep<true>(X) : NewtonStep<false>(X);
  }
  for (int entry = 0; entry < 9; ++entry) {
    for (int k = 0; k < kSize; ++k) {
      batch->matrix[entry][k] = reliable[k] != 0.0 ? X[entry][k] : batch->matrix[entry][k];
    }
  }
}

// With v = sin(angle) axis from the skew part and c = cos(angle) from the trace:
// R^h = I + sin(h angle)/|v| [v] + (1 - cos(h angle))/|v|^2 [v]^2   (Rodrigues).
inline __attribute__((always_inline)) void RotationPowersBody(const double* exponents,
                                                              RotationBatch* batch) {
  // Under this sine the quotients are replaced by their limits, whose error is its square.
  constexpr double kSmallSine = 1e-8;
  constexpr double kNearHalfTurnCosine = -0.9999;
  double(*m)[kSize] = batch->matrix;
  for (int k = 0; k < kSize; ++k) {
    const double x = 0.5 * (m[7][k] - m[5][k]);
    const double y = 0.5 * (m[2][k] - m[6][k]);
    const double z = 0.5 * (m[3][k] - m[1][k]);
    const double cosine = 0.5 * (m[0][k] + m[4][k] + m[8][k] - 1.0);
    const double sine2 = x * x + y * y + z * z;
    const double sine = std::sqrt(sine2);
    const double h = exponents[k];
    const double angle = std::atan2(sine, cosine);
    const bool small = sine < kSmallSine;
    const double inverse = 1.0 / (small ? 1.0 : sine);
    const double a = small ? h : std::sin(h * angle) * inverse;
    // 1 - cos t = 2 sin^2(t/2) keeps its digits for small t.
    const double half_sine = std::sin(0.5 * h * angle) * inverse;
    const double b = small ? 0.5 * h * h : 2.0 * half_sine * half_sine;
    const double good = cosine > kNearHalfTurnCosine ? batch->reliable[k] : 0.0;
    const double keep = 1.0 - good;
    m[0][k] = good * (1.0 - b * (y * y + z * z)) + keep * m[0][k];
    m[1][k] = good * (b * x * y - a * z) + keep * m[1][k];
    m[2][k] = good * (b * x * z + a * y) + keep * m[2][k];
    m[3][k] = good * (b * x * y + a * z) + keep * m[3][k];
    m[4][k] = good * (1.0 - b * (x * x + z * z)) + keep * m[4][k];
    m[5][k] = good * (b * y * z - a * x) + keep * m[5][k];
    m[6][k] = good * (b * x * z - a * y) + keep * m[6][k];
    m[7][k] = good * (b * y * z + a * x) + keep * m[7][k];
    m[8][k] = good * (1.0 - b * (x * x + y * y)) + keep * m[8][k];
    batch->reliable[k] = good;
  }
}

TISSUEFORM_TARGET_AVX512 void ClosestRotationsAvx512(RotationBatch* batch) {
  ClosestRotationsBody(batch);
}
TISSUEFORM_TARGET_AVX2 void ClosestRotationsAvx2(RotationBatch* batch) {
  ClosestRotationsBody(batch);
}
void ClosestRotationsBaseline(RotationBatch* batch) { ClosestRotationsBody(batch); }

TISSUEFORM_TARGET_AVX512 void RotationPowersAvx512(const double* exponents, RotationBatch* batch) {
  RotationPowersBody(exponents, batch);
}
TISSUEFORM_TARGET_AVX2 void RotationPowersAvx2(const double* exponents, RotationBatch* batch) {
  RotationPowersBody(exponents, batch);
}
void RotationPowersBaseline(const double* exponents, RotationBatch* batch) {
  RotationPowersBody(exponents, batch);
}

constexpr KernelVersions<void(RotationBatch*)> kClosestRotations{
    ClosestRotationsBaseline, ClosestRotationsAvx2, ClosestRotationsAvx512};
constexpr KernelVersions<void(const double*, RotationBatch*)> kRotationPowers{
    RotationPowersBaseline, RotationPowersAvx2, RotationPowersAvx512};

}  // namespace

void ClosestRotations(RotationBatch* batch) { kClosestRotations.Active()(batch); }

void RotationPowers(const double* exponents, RotationBatch* batch) {
  kRotationPowers.Active()(exponents, batch);
}

}  // namespace tissueform
