// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <span>
#include <vector>

#include "core/mechanics/answer_evaluator/answer_pose.h"
#include "core/mechanics/answer_evaluator/portable_answers.h"

namespace tissueform {

// The propagated rotation field of gradient_field as a polynomial of the harmonic values,
//   P(u) - I = (1 + sum_h u_h (s_h - 1)) exp([sum_h u_h w_h]) - I = sum_n C_n(poses) B_n(u),
// by interpolation in as many points as there are polynomials of the degree. P is entire, so the
// coefficients fall faster than geometrically with the degree. Exactly zero for poses that neither
// turn nor scale.
struct RotationCoefficients {
  std::vector<double> coefficients;  // of every polynomial a 3 by 3 matrix, row-major
  // How far what is left out can put a vertex off: the guards' coefficients times their gains, of
  // those beyond with an allowance, and the remainder.
  double truncation_mm = 0;
};

// How far P is from what interpolation of degree n makes of it: with r the radius of a ball around
// all rotation vectors (Jung's theorem), s the mean and d the half range of the scale,
//   s E_n + d E_(n-1),   E_n = min(1, 2^(4-n)) r^(n+1) / (n+1)!.
// r^(n+1) / (n+1)! is Taylor's remainder (turning by [w] does not lengthen), 2^-n what Chebyshev's
// expansion gains on it, and 2^4 an allowance for interpolating instead of approximating best.
double RemainderBound(const PortableAnswers& answers, std::span<const AnswerPose> poses,
                      int degree);

// REQUIRES: CheckAnswers finds nothing; answers of gradient_field; a pose for every handle.
RotationCoefficients ExpandRotation(const PortableAnswers& answers,
                                    std::span<const AnswerPose> poses);

}  // namespace tissueform
