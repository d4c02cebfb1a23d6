// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

// The bodies of BasicAnswerEvaluator, for those who instantiate it with a matrix of their own.

#include <algorithm>
#include <cstddef>
#include <limits>
#include <utility>

#include "core/mechanics/answer_evaluator/answer_band.h"
#include "core/mechanics/answer_evaluator/answer_evaluator.h"
#include "core/mechanics/answer_evaluator/compression_error.h"
#include "core/mechanics/answer_evaluator/pose_factors.h"
#include "core/mechanics/answer_evaluator/pose_range.h"

namespace tissueform {

template <typename Matrix>
BasicAnswerEvaluator<Matrix>::BasicAnswerEvaluator(PortableAnswers answers)
    : answers_(std::move(answers)),
      sizes_(SizesOf(answers_)),
      places_(answers_),
      contact_(answers_),
      free_(answers_, sizes_) {
  if constexpr (Matrix::kKeepsEntries) {
    for (PackedColumns* packed : {&answers_.columns, &answers_.cluster_map}) {
      packed->upper = {};
      packed->lower = {};
    }
  }
}

template <typename Matrix>
double BasicAnswerEvaluator<Matrix>::ErrorMm(std::span<const AnswerPose> poses) const {
  return CheckedProductOf(poses).error_mm;
}

template <typename Matrix>
bool BasicAnswerEvaluator<Matrix>::Covers(std::span<const AnswerPose> poses) const {
  return AreCovered(answers_, poses, ErrorMm(poses));
}

template <typename Matrix>
bool BasicAnswerEvaluator<Matrix>::Answer(std::span<const AnswerPose> poses, float* positions,
                                          double* error_mm) const {
  const Product product = CheckedProductOf(poses);
  if (error_mm != nullptr) *error_mm = product.error_mm;
  if (!AreCovered(answers_, poses, product.error_mm)) return false;
  Write(poses, product, positions);
  return true;
}

template <typename Matrix>
bool BasicAnswerEvaluator<Matrix>::Answer(std::span<const AnswerPose> poses,
                                          std::vector<float>* positions, double* error_mm) const {
  const Product product = CheckedProductOf(poses);
  if (error_mm != nullptr) *error_mm = product.error_mm;
  if (!AreCovered(answers_, poses, product.error_mm)) return false;
  positions->resize(3 * answers_.regions.size());
  Write(poses, product, positions->data());
  return true;
}

template <typename Matrix>
std::vector<ChosenVertex> BasicAnswerEvaluator<Matrix>::Choose(
    std::span<const int32_t> vertices) const {
  std::vector<ChosenVertex> chosen;
  chosen.reserve(vertices.size());
  for (const int32_t vertex : vertices) {
    const auto place = static_cast<size_t>(vertex);
    ChosenVertex& found = chosen.emplace_back();
    found.region = answers_.regions[place];
    for (size_t before = 0; before < place; ++before) {
      const int32_t other = answers_.regions[before];
      const bool is_alike = found.region < 0 ? other == found.region : other >= 0;
      if (is_alike) ++found.rank;
    }
    if (found.region == PortableAnswers::kFree) free_.Find(answers_, sizes_, &found);
  }
  return chosen;
}

template <typename Matrix>
void BasicAnswerEvaluator<Matrix>::Evaluate(std::span<const AnswerPose> poses,
                                            float* positions) const {
  Write(poses, ProductOf(poses), positions);
}

template <typename Matrix>
bool BasicAnswerEvaluator<Matrix>::Band(std::span<const AnswerPose> poses,
                                        std::vector<float>* band_mm) const {
  const auto turns_too_far = [this](const AnswerPose& pose) {
    return !HasBand(RowNorm(pose.rotation_vector.data(), 3), answers_.numbers.max_rotation_rad);
  };
  if (!has_band() || !AreLegal(answers_, poses) ||
      std::any_of(poses.begin(), poses.end(), turns_too_far)) {
    return false;
  }
  const std::vector<float> of_free = BandOfFree(answers_, poses);
  band_mm->assign(answers_.regions.size(), 0.0F);
  places_.ForEachFree([&](size_t place, size_t number) { (*band_mm)[place] = of_free[number]; });
  return true;
}

template <typename Matrix>
TouchForces BasicAnswerEvaluator<Matrix>::TouchForcesAt(std::span<const AnswerPose> poses) const {
  if (!AreLegal(answers_, poses)) return {};
  return contact_.At(answers_, FactorsOf(answers_, poses).factors);
}

template <typename Matrix>
typename BasicAnswerEvaluator<Matrix>::Product BasicAnswerEvaluator<Matrix>::CheckedProductOf(
    std::span<const AnswerPose> poses) const {
  if (AreLegal(answers_, poses)) return ProductOf(poses);
  return {.factors = {}, .reading = {}, .error_mm = std::numeric_limits<double>::infinity()};
}

template <typename Matrix>
typename BasicAnswerEvaluator<Matrix>::Product BasicAnswerEvaluator<Matrix>::ProductOf(
    std::span<const AnswerPose> poses) const {
  PoseFactors of_poses = FactorsOf(answers_, poses);
  of_poses.model_error_mm += contact_.Append(answers_, &of_poses.factors);
  Product product;
  product.error_mm = of_poses.model_error_mm;
  product.factors = free_.Map(answers_, sizes_, of_poses.factors);
  if (sizes_.pairs == 0) {
    const double room_mm =
        Matrix::kReadsByTolerance ? answers_.numbers.tolerance_mm - of_poses.model_error_mm : 0;
    const PlannedReading reading =
        PlanReading(answers_, sizes_, of_poses.factors, product.factors, room_mm);
    product.reading = reading.columns;
    product.error_mm += reading.error_mm;
  }
  product.error_mm = std::max(product.error_mm, places_.ErrorMm(poses));
  return product;
}

template <typename Matrix>
void BasicAnswerEvaluator<Matrix>::Write(std::span<const AnswerPose> poses, const Product& product,
                                         float* positions) const {
  free_.Move(answers_, sizes_, product.factors, product.reading, positions);
  places_.Complete(answers_, poses, positions);
}

template <typename Matrix>
size_t BasicAnswerEvaluator<Matrix>::bytes_held() const {
  size_t bytes = free_.bytes_held() + places_.bytes_held();
  VisitSections(answers_, [&bytes](uint32_t /*number*/, const auto& values) {
    bytes += values.size() * sizeof(values[0]);
  });
  return bytes;
}

}  // namespace tissueform
