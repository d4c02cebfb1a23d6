// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/answer_evaluator/compression_error.h"

#include <array>
#include <cmath>
#include <cstddef>

#include "core/mechanics/answer_evaluator/answer_pose.h"
#include "core/mechanics/answer_evaluator/answer_sizes.h"

namespace tissueform {
namespace {

constexpr double kHalfUnit = 5.98e-8;  // 2^-24 and a little for terms of second order
constexpr double kBoundRounding = 1 + 1e-4;
constexpr double kUpper = 65536;  // steps in one of the upper half

// What was cut.
double CutErrorMm(const PortableAnswers& answers, const AnswerSizes& sizes,
                  const std::vector<double>& factors) {
  const size_t width = sizes.factor_width;
  double error = 0;
  for (size_t first = 0; first < answers.cut_map.size(); first += sizes.factors) {
    std::array<double, 3> sums = {};
    for (size_t j = 0; j < sizes.factors; ++j) {
      for (size_t f = 0; f < width; ++f) {
        sums[f] += double{answers.cut_map[first + j]} * factors[j * width + f];
      }
    }
    error += RowNorm(sums.data(), width);
  }
  for (size_t j = 0; j < sizes.factors; ++j) {
    error += double{answers.tail[j]} * RowNorm(factors.data() + j * width, width);
  }
  return kBoundRounding * error;
}

}  // namespace

double CompressionErrorMm(const PortableAnswers& answers, const std::vector<double>& factors,
                          const std::vector<double>& mapped) {
  const AnswerSizes sizes = SizesOf(answers);
  const size_t width = sizes.factor_width;
  // Half a step in every coordinate, which three factors turn together.
  const double half_step = (width == 3 ? 0.5 : 0.5 * std::sqrt(3.0)) * kUpper;
  double digits = 0;
  double sum = 0;
  double partial_sums = 0;
  for (size_t c = 0; c < sizes.columns; ++c) {
    const double size = RowNorm(mapped.data() + c * width, width);
    if (c + sizes.full_columns < sizes.columns) {
      digits += half_step * answers.columns.steps[c] * size;
    }
    sum += size * answers.gains[c];
    partial_sums += sum;
  }
  return CutErrorMm(answers, sizes, factors) + digits +
         kHalfUnit * (3 * sum + partial_sums + 2 * answers.numbers.largest_rest_mm + sum);
}

}  // namespace tissueform
