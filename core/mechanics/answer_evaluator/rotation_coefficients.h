// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <span>
#include <vector>

#include "core/mechanics/answer_evaluator/answer_pose.h"
#include "core/mechanics/answer_evaluator/portable_answers.h"

namespace tissueform {

// The rotation field of gradient_field as polynomials of the harmonic values (see RotationExpansion
// of core/mechanics/prepared_answers).
struct RotationCoefficients {
  std::vector<double> coefficients;  // of every polynomial a 3 by 3 matrix, row-major
  // How far what is left out can put a vertex off: the guards' coefficients times their gains, of
  // those beyond with an allowance, and the remainder.
  double truncation_mm = 0;
};

// REQUIRES: CheckAnswers finds nothing; answers of gradient_field; a pose for every handle.
RotationCoefficients ExpandRotation(const PortableAnswers& answers,
                                    std::span<const AnswerPose> poses);

}  // namespace tissueform
