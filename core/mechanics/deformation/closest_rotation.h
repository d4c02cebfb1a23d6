// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <Eigen/Core>

namespace tissueform {

// The rotation R (det +1) that minimises ||R - F|| in the Frobenius norm, from the singular value
// decomposition; for any F, also singular or reflecting.
Eigen::Matrix3d ClosestRotation(const Eigen::Matrix3d& F);

// exp(exponent * log(R)) with the logarithm of angle in [0, pi].
Eigen::Matrix3d RotationPower(const Eigen::Matrix3d& R, double exponent);

// Many matrices at once, laid out so that the compiler works on several lanes in one instruction.
// Which instructions (AVX-512, AVX2 or the baseline) is chosen once at run time, so one program
// runs everywhere.
struct RotationBatch {
  static constexpr int kSize = 64;

  // Entry (i, j) of matrix k lies at matrix[3 * i + j][k].
  alignas(64) double matrix[9][kSize];
  // Set to 0 where a batch function could not answer reliably; the matrix is then as it was and the
  // scalar function above must be used.
  alignas(64) double reliable[kSize];
};

// Replaces every matrix by its closest rotation: Newton's iteration for the polar decomposition
// (Higham 1986). Unreliable where the determinant is not clearly positive.
void ClosestRotations(RotationBatch* batch);

// Replaces every rotation R by RotationPower(R, exponents[k]). Unreliable near half a turn, where
// the axis cannot be read off the skew part. Lanes that are unreliable already are left alone.
void RotationPowers(const double* exponents, RotationBatch* batch);

}  // namespace tissueform
