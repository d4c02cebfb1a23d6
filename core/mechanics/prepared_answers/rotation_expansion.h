// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>

#include "absl/types/span.h"
#include <Eigen/Core>

#include "core/mechanics/answer_evaluator/portable_answers.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/prepared_answers/simplex_polynomials.h"

namespace tissueform {

// Coefficients C_n, a 3 by 3 matrix each, row-major in a row of nine.
using ExpansionCoefficients = Eigen::Matrix<double, Eigen::Dynamic, 9, Eigen::RowMajor>;

// The propagated rotation field as a polynomial of the harmonic values,
//   P(u) - I = (1 + sum_h u_h (s_h - 1)) exp([sum_h u_h w_h]) - I = sum_n C_n(poses) B_n(u),
// by interpolation in as many points as there are polynomials of the degree. P is entire, so the
// coefficients fall faster than geometrically with the degree.
class RotationExpansion {
 public:
  // `degree` is the largest total degree.
  RotationExpansion(const SimplexDomain& domain, int degree);

  const SimplexPolynomials& polynomials() const { return polynomials_; }

  // Exactly zero for poses that neither turn nor scale. REQUIRES: one legal pose per handle.
  ExpansionCoefficients Expand(absl::Span<const HandlePose> poses) const;

  // How far P is from what interpolation of degree n makes of it: with r the radius of a ball
  // around all rotation vectors (Jung's theorem), s the mean and d the half range of the scale,
  //   s E_n + d E_(n-1),   E_n = min(1, 2^(4-n)) r^(n+1) / (n+1)!.
  // r^(n+1) / (n+1)! is Taylor's remainder (turning by [w] does not lengthen), 2^-n what
  // Chebyshev's expansion gains on it, and 2^4 an allowance for interpolating instead of
  // approximating best.
  double RemainderBound(absl::Span<const HandlePose> poses, int degree) const;

  // Writes degree, nodes, interpolation and the simplex.
  void Describe(PortableAnswers* answers) const;

  int64_t bytes_held() const;
  static int64_t BytesNeeded(int dimension, int degree);

 private:
  SimplexDomain domain_;
  SimplexPolynomials polynomials_;
  Eigen::MatrixXd nodes_;          // u at the interpolation points, one a row
  Eigen::MatrixXd interpolation_;  // from values at the points to coefficients
};

}  // namespace tissueform
