// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/answer_evaluator/pose_factors.h"

#include <cstddef>

#include "core/mechanics/answer_evaluator/answer_sizes.h"
#include "core/mechanics/answer_evaluator/rotation_coefficients.h"
#include "core/mechanics/answer_evaluator/series_terms.h"

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

PoseFactors NeoHookeanFactors(const PortableAnswers& answers, std::span<const AnswerPose> poses) {
  PoseFactors result;
  AddElasticFactors(answers, poses, &result.factors);
  const SeriesTerms terms = TermsOf(answers, NumbersOf(answers, poses));
  result.factors.insert(result.factors.end(), terms.pairs.begin(), terms.pairs.end());
  for (const double product : terms.triples) {
    result.factors.push_back(product / (1 + terms.ratio));
  }
  result.model_error_mm = SeriesErrorMm(answers, terms) + answers.numbers.rounding_mm +
                          answers.numbers.cut_per_mm * FirstOrderMm(answers, terms.numbers);
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
