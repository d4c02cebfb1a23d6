// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "core/mechanics/answer_evaluator/answer_sizes.h"
#include "core/mechanics/answer_evaluator/packed_matrix.h"
#include "core/mechanics/answer_evaluator/portable_answers.h"

namespace tissueform {

// Of gradient_field and linear_elastic. `factors`: as they go into the map, #factors by the width,
// row-major; `mapped`: as they come out.

// How far, in mm, a free vertex can be put off by what was cut of the columns.
double CutErrorMm(const PortableAnswers& answers, const AnswerSizes& sizes,
                  const std::vector<double>& factors);

// By single precision: every stored entry, factor, product and partial sum is counted with half a
// unit in the last place of the largest value that it can take.
double RoundingErrorMm(const PortableAnswers& answers, const AnswerSizes& sizes,
                       const std::vector<double>& mapped);

// By one column that is read without lower halves, a unit of the size of its factors.
double UpperHalfErrorMm(double step, size_t width);

// What is read of the columns, and all that this and the compression put a vertex off by: a bound,
// not an estimate.
struct PlannedReading {
  ColumnReading columns;
  double error_mm = 0;
};

// The least that keeps the error within the tolerance, since a frame takes the time that its
// reading does; all where that is not enough, as with a tolerance of 0.
PlannedReading PlanReading(const PortableAnswers& answers, const AnswerSizes& sizes,
                           const std::vector<double>& factors, const std::vector<double>& mapped,
                           double tolerance_mm);

}  // namespace tissueform
