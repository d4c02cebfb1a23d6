// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/answer_evaluator/answer_band.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "core/mechanics/answer_evaluator/answer_sizes.h"
#include "core/mechanics/answer_evaluator/packed_matrix.h"
#include "core/mechanics/answer_evaluator/pose_factors.h"
#include "core/mechanics/answer_evaluator/small_product.h"

namespace tissueform {
namespace {

// Square roots of the 95th percentiles of chi-squared with 1, 2 and 3 degrees of freedom, and the
// parabola through them.
double RootOf95thPercentile(double degrees) {
  constexpr double kOfOne = 1.959964;
  constexpr double kOfTwo = 2.447747;
  constexpr double kOfThree = 2.795483;
  const double x = degrees - 2;
  return kOfTwo + 0.5 * (kOfThree - kOfOne) * x + 0.5 * (kOfOne - 2 * kOfTwo + kOfThree) * x * x;
}

// Of a vertex whose covariance has these sums of variances and of all entries' squares.
float BandMm(double trace, double squares) {
  if (squares <= 0) return 0;
  const double degrees = std::clamp(trace * trace / squares, 1.0, 3.0);
  return static_cast<float>(std::sqrt(squares / trace) * RootOf95thPercentile(degrees));
}

std::vector<double> MappedFactors(const PortableAnswers& answers,
                                  std::span<const AnswerPose> poses) {
  std::vector<double> factors;
  AddElasticFactors(answers, poses, &factors);
  std::vector<double> mapped(answers.band.steps.size());
  MultiplySmall(answers.band_map.data(), factors.data(), {mapped.size(), factors.size(), 1},
                mapped.data());
  return mapped;
}

}  // namespace

std::vector<float> BandOfFree(const PortableAnswers& answers, std::span<const AnswerPose> poses) {
  const AnswerSizes sizes = SizesOf(answers);
  const std::vector<double> mapped = MappedFactors(answers, poses);
  const size_t rows = 3 * sizes.free;
  const PackedColumns& band = answers.band;
  std::vector<float> fields(rows * sizes.band_variables);
  const PackedMatrix columns(PackedPart{band.steps.data(), band.upper.data(), nullptr,
                                        fields.size(), band.steps.size(), 0});
  columns.Multiply(mapped.data(), 1, {.first = 0, .first_full = columns.columns()}, fields.data());
  std::vector<float> result(sizes.free);
  for (size_t v = 0; v < sizes.free; ++v) {
    double covariance[3][3] = {};
    for (size_t variable = 0; variable < sizes.band_variables; ++variable) {
      const float* const move = fields.data() + variable * rows + 3 * v;
      for (size_t i = 0; i < 3; ++i) {
        for (size_t j = 0; j < 3; ++j) covariance[i][j] += double{move[i]} * double{move[j]};
      }
    }
    double squares = 0;
    for (const auto& row : covariance) {
      for (const double entry : row) squares += entry * entry;
    }
    result[v] = BandMm(covariance[0][0] + covariance[1][1] + covariance[2][2], squares);
  }
  return result;
}

}  // namespace tissueform
