// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <span>
#include <vector>

#include "core/mechanics/answer_evaluator/answer_pose.h"
#include "core/mechanics/answer_evaluator/portable_answers.h"

namespace tissueform {

// What columns are multiplied with, and what that implies for the error. REQUIRES: CheckAnswers
// finds nothing in `answers`; a pose for every handle.
struct PoseFactors {
  std::vector<double> factors;  // #factors by 3 (gradient_field) or 1, row-major
  // Of gradient_field what the expansion leaves out, of neo_hookean the estimate with all that is
  // counted in, of linear_elastic nothing.
  double model_error_mm = 0;
};
// Without the forces of contact (ContactForces).
PoseFactors FactorsOf(const PortableAnswers& answers, std::span<const AnswerPose> poses);

// 12 numbers a handle: A and b about the origin of the elastic columns, appended.
void AddElasticFactors(const PortableAnswers& answers, std::span<const AnswerPose> poses,
                       std::vector<double>* factors);

}  // namespace tissueform
