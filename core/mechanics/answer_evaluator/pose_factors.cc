// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/answer_evaluator/pose_factors.h"

#include <array>
#include <cmath>
#include <cstddef>

#include "core/mechanics/answer_evaluator/answer_sizes.h"
#include "core/mechanics/answer_evaluator/rotation_coefficients.h"

namespace tissueform {
namespace {

PoseFactors GradientFactors(const PortableAnswers& answers, std::span<const AnswerPose> poses) {
  const RotationCoefficients expansion = ExpandRotation(answers, poses);
  const auto polynomials = static_cast<size_t>(answers.numbers.num_polynomials);
  PoseFactors result;
  result.model_error_mm = expansion.truncation_mm;
  result.factors.resize(3 * (3 * polynomials + 4 * poses.size()));
  for (size_t n = 0; n < polynomials; ++n) {
    const double* const C = expansion.coefficients.data() + 9 * n;
    double* const block = result.factors.data() + 9 * (polynomials - 1 - n);
    for (size_t i = 0; i < 3; ++i) {
      for (size_t j = 0; j < 3; ++j) block[3 * j + i] = C[3 * i + j];
    }
  }
  for (size_t h = 0; h < poses.size(); ++h) {
    const AnswerMotion motion = MotionAbout(poses[h], answers.origins.data() + 3 * h);
    double* const block = result.factors.data() + 3 * (3 * polynomials + 4 * h);
    for (size_t i = 0; i < 3; ++i) {
      for (size_t j = 0; j < 3; ++j) block[3 * j + i] = motion.turn[3 * i + j];
      block[9 + i] = motion.move_mm[i];
    }
  }
  return result;
}

// Of every handle the sine of its turn times the axis, and how its middle moves.
std::vector<double> NumbersOf(const PortableAnswers& answers, std::span<const AnswerPose> poses) {
  std::vector<double> numbers;
  for (size_t h = 0; h < poses.size(); ++h) {
    const std::array<double, 9> R = TurnMinusIdentity(poses[h].rotation_vector, 1);
    numbers.push_back(0.5 * (R[7] - R[5]));
    numbers.push_back(0.5 * (R[2] - R[6]));
    numbers.push_back(0.5 * (R[3] - R[1]));
    const std::array<double, 3> move =
        MotionAbout(poses[h], answers.centroids.data() + 3 * h).move_mm;
    numbers.insert(numbers.end(), move.begin(), move.end());
  }
  return numbers;
}

// The length of what a matrix of that many columns gives of the products.
double LengthOf(const std::vector<float>& rows, const std::vector<double>& products) {
  double square = 0;
  for (size_t first = 0; first < rows.size(); first += products.size()) {
    double sum = 0;
    for (size_t p = 0; p < products.size(); ++p) sum += double{rows[first + p]} * products[p];
    square += sum * sum;
  }
  return std::sqrt(square);
}

// How long the third order is beside the second.
double RatioOf(const PortableAnswers& answers, const std::vector<double>& pairs,
               const std::vector<double>& triples) {
  const double second = LengthOf(answers.second_lengths, pairs);
  return second > 0 ? LengthOf(answers.third_lengths, triples) / second : 0;
}

// The root of the sum of the squares of what single products do.
double SingleMm(const std::vector<double>& gains, const std::vector<double>& products) {
  double square = 0;
  for (size_t p = 0; p < products.size(); ++p) {
    const double single = gains[p] * products[p];
    square += single * single;
  }
  return std::sqrt(square);
}

// Of second order: c (|u2| s2)^(3/4) / L^(1/2).
double EstimateMm(const PortableAnswers& answers, const std::vector<double>& products) {
  const size_t pairs = products.size();
  double farthest = 0;
  for (size_t first = 0; first < answers.probes.size(); first += 3 * pairs) {
    double square = 0;
    for (size_t row = 0; row < 3; ++row) {
      double sum = 0;
      for (size_t p = 0; p < pairs; ++p) {
        sum += double{answers.probes[first + row * pairs + p]} * products[p];
      }
      square += sum * sum;
    }
    farthest = std::fmax(farthest, std::sqrt(square));
  }
  const double root = std::sqrt(farthest * SingleMm(answers.second_gains, products));
  return answers.numbers.estimate_scale * root * std::sqrt(root / answers.numbers.size_mm);
}

// For all pairs a <= b, those of two different ones twice.
std::vector<double> PairProductsOf(const std::vector<double>& numbers) {
  std::vector<double> products;
  for (size_t a = 0; a < numbers.size(); ++a) {
    for (size_t b = a; b < numbers.size(); ++b) {
      products.push_back((a == b ? 1 : 2) * numbers[a] * numbers[b]);
    }
  }
  return products;
}

// For all a <= b <= c, as often as there are orders of the three.
std::vector<double> TripleProductsOf(const std::vector<double>& numbers) {
  std::vector<double> products;
  for (size_t a = 0; a < numbers.size(); ++a) {
    for (size_t b = a; b < numbers.size(); ++b) {
      for (size_t c = b; c < numbers.size(); ++c) {
        const double orders = a == c ? 1 : a == b || b == c ? 3 : 6;
        products.push_back(orders * numbers[a] * numbers[b] * numbers[c]);
      }
    }
  }
  return products;
}

PoseFactors NeoHookeanFactors(const PortableAnswers& answers, std::span<const AnswerPose> poses) {
  PoseFactors result;
  AddElasticFactors(answers, poses, &result.factors);
  const std::vector<double> numbers = NumbersOf(answers, poses);
  const std::vector<double> pairs = PairProductsOf(numbers);
  result.factors.insert(result.factors.end(), pairs.begin(), pairs.end());
  double series_mm = EstimateMm(answers, pairs);
  if (!answers.third_lengths.empty()) {
    const std::vector<double> triples = TripleProductsOf(numbers);
    const double ratio = RatioOf(answers, pairs, triples);
    for (const double product : triples) result.factors.push_back(product / (1 + ratio));
    series_mm = std::fmax(series_mm, SingleMm(answers.third_gains, triples)) * ratio / (1 + ratio);
  }
  result.model_error_mm = series_mm + answers.numbers.rounding_mm +
                          answers.numbers.cut_per_mm * SingleMm(answers.first_gains, numbers);
  return result;
}

}  // namespace

void AddElasticFactors(const PortableAnswers& answers, std::span<const AnswerPose> poses,
                       std::vector<double>* factors) {
  for (const AnswerPose& pose : poses) {
    const AnswerMotion motion = MotionAbout(pose, answers.origins.data());
    for (size_t i = 0; i < 3; ++i) {
      for (size_t j = 0; j < 3; ++j) factors->push_back(motion.turn[3 * i + j]);
      factors->push_back(motion.move_mm[i]);
    }
  }
}

PoseFactors FactorsOf(const PortableAnswers& answers, std::span<const AnswerPose> poses) {
  if (IsModel(answers, AnswerModel::kGradientField)) {
    return GradientFactors(answers, poses);
  }
  if (IsModel(answers, AnswerModel::kNeoHookean)) {
    return NeoHookeanFactors(answers, poses);
  }
  PoseFactors result;
  AddElasticFactors(answers, poses, &result.factors);
  return result;
}

}  // namespace tissueform
