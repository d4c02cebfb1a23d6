// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/answer_evaluator/compression_error.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "core/mechanics/answer_evaluator/answer_pose.h"
#include "core/mechanics/answer_evaluator/small_product.h"

namespace tissueform {
namespace {

constexpr double kHalfUnit = 5.98e-8;  // 2^-24 and a little for terms of second order
constexpr double kBoundRounding = 1 + 1e-4;
constexpr double kUpper = 65536;  // steps in one of the upper half
// Part of the tolerance: what a frame leaves out of its small columns, where the digits of the
// others allow it.
constexpr double kLeftOutOfTolerance = 0.2;

std::vector<double> RowNorms(const std::vector<double>& matrix, size_t width) {
  std::vector<double> norms(matrix.size() / width);
  for (size_t row = 0; row < norms.size(); ++row) {
    norms[row] = RowNorm(matrix.data() + row * width, width);
  }
  return norms;
}

double RoundingOfSizesMm(const PortableAnswers& answers, const std::vector<double>& norms) {
  double sum = 0;
  double partial_sums = 0;
  for (size_t c = 0; c < norms.size(); ++c) {
    sum += norms[c] * answers.gains[c];
    // Columns are added in their order and small ones come first, so the early partial sums, which
    // every later rounding is measured by, stay small.
    partial_sums += sum;
  }
  // Entry, factor and product of every column, every partial sum; the rest, the result.
  return kHalfUnit * (3 * sum + partial_sums + 2 * answers.numbers.largest_rest_mm + sum);
}

}  // namespace

double CutErrorMm(const PortableAnswers& answers, const AnswerSizes& sizes,
                  const std::vector<double>& factors) {
  const size_t width = sizes.factor_width;
  const std::vector<float> singles(factors.begin(), factors.end());
  const size_t rows = sizes.factors > 0 ? answers.cut_map.size() / sizes.factors : 0;
  std::vector<float> cut(rows * width);
  MultiplySmall(answers.cut_map.data(), singles.data(), {rows, sizes.factors, width}, cut.data());
  double error = 0;
  for (size_t row = 0; row < rows; ++row) error += RowNorm(cut.data() + row * width, width);
  for (size_t j = 0; j < sizes.factors; ++j) {
    error += double{answers.tail[j]} * RowNorm(singles.data() + j * width, width);
  }
  return kBoundRounding * error;
}

double RoundingErrorMm(const PortableAnswers& answers, const AnswerSizes& sizes,
                       const std::vector<double>& mapped) {
  return RoundingOfSizesMm(answers, RowNorms(mapped, sizes.factor_width));
}

double UpperHalfErrorMm(double step, size_t width) {
  // Half a step in every coordinate, which three factors turn together.
  return (width == 3 ? 0.5 : 0.5 * std::sqrt(3.0)) * kUpper * step;
}

PlannedReading PlanReading(const PortableAnswers& answers, const AnswerSizes& sizes,
                           const std::vector<double>& factors, const std::vector<double>& mapped,
                           double tolerance_mm) {
  const std::vector<double> norms = RowNorms(mapped, sizes.factor_width);
  const double of_all = CutErrorMm(answers, sizes, factors) + RoundingOfSizesMm(answers, norms);
  const auto of_digits = [&](size_t c) {
    return UpperHalfErrorMm(answers.columns.steps[c], sizes.factor_width) * norms[c];
  };
  PlannedReading reading;
  double left_out = 0;
  size_t& first = reading.columns.first;
  for (; first < sizes.columns; ++first) {
    const double more = norms[first] * answers.gains[first];
    if (left_out + more > kLeftOutOfTolerance * tolerance_mm) break;
    left_out += more;
  }
  // From the most important one on columns are read to their last digit until it is enough.
  const size_t only_upper = sizes.columns - sizes.full_columns;
  double digits = 0;
  for (size_t c = first; c < sizes.columns; ++c) digits += of_digits(c);
  size_t& first_full = reading.columns.first_full;
  first_full = sizes.columns;
  while (of_all + left_out + digits > tolerance_mm && first_full > std::max(only_upper, first)) {
    --first_full;
    digits -= of_digits(first_full);
  }
  reading.error_mm = of_all + left_out + std::max(digits, 0.0);
  if (reading.error_mm <= tolerance_mm) return reading;
  // Not within the tolerance: read everything, so that Evaluate, which may still be called, is as
  // exact as it can be.
  reading = {.columns = {.first = 0, .first_full = only_upper}, .error_mm = of_all};
  for (size_t c = 0; c < only_upper; ++c) reading.error_mm += of_digits(c);
  return reading;
}

}  // namespace tissueform
