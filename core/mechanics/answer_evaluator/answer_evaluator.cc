// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/answer_evaluator/answer_evaluator.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "core/mechanics/answer_evaluator/answer_band.h"
#include "core/mechanics/answer_evaluator/compression_error.h"
#include "core/mechanics/answer_evaluator/packed_product.h"
#include "core/mechanics/answer_evaluator/pose_factors.h"
#include "core/mechanics/answer_evaluator/pose_range.h"

namespace tissueform {

AnswerEvaluator::AnswerEvaluator(PortableAnswers answers)
    : answers_(std::move(answers)), sizes_(SizesOf(answers_)), held_(answers_) {}

double AnswerEvaluator::ErrorMm(std::span<const AnswerPose> poses) const {
  if (!AreLegal(answers_, poses)) return std::numeric_limits<double>::infinity();
  return ProductOf(poses).error_mm;
}

bool AnswerEvaluator::Covers(std::span<const AnswerPose> poses) const {
  return AreCovered(answers_, poses, ErrorMm(poses));
}

bool AnswerEvaluator::Answer(std::span<const AnswerPose> poses, std::vector<float>* positions,
                             double* error_mm) const {
  if (error_mm != nullptr) *error_mm = std::numeric_limits<double>::infinity();
  if (!AreLegal(answers_, poses)) return false;
  const Product product = ProductOf(poses);
  if (error_mm != nullptr) *error_mm = product.error_mm;
  if (!AreCovered(answers_, poses, product.error_mm)) return false;
  std::vector<float> moves(3 * sizes_.free, 0.0F);
  if (sizes_.pairs > 0) {
    MoveClusters(product.factors, &moves);
  } else {
    MoveFree(product.factors, &moves);
  }
  Place(poses, moves, positions);
  return true;
}

bool AnswerEvaluator::Band(std::span<const AnswerPose> poses, std::vector<float>* band_mm) const {
  const auto turns_too_far = [this](const AnswerPose& pose) {
    return !HasBand(RowNorm(pose.rotation_vector.data(), 3), answers_.numbers.max_rotation_rad);
  };
  if (!has_band() || !AreLegal(answers_, poses) ||
      std::any_of(poses.begin(), poses.end(), turns_too_far)) {
    return false;
  }
  const std::vector<float> of_free = BandOfFree(answers_, poses);
  band_mm->assign(answers_.regions.size(), 0.0F);
  ForEachVertex(answers_, [&](size_t place, int32_t region, size_t first) {
    if (region == PortableAnswers::kFree) (*band_mm)[place] = of_free[first / 3];
  });
  return true;
}

AnswerEvaluator::Product AnswerEvaluator::ProductOf(std::span<const AnswerPose> poses) const {
  const PoseFactors of_poses = FactorsOf(answers_, poses);
  const size_t width = sizes_.factor_width;
  Product product;
  product.error_mm = of_poses.model_error_mm;
  product.factors.assign(sizes_.columns * width, 0);
  if (sizes_.pairs > 0) {
    const PackedColumns& map = answers_.cluster_map;
    AddPackedProduct({map.steps.data(), map.upper.data(), map.lower.data(), sizes_.columns,
                      sizes_.factors, sizes_.full_map_cols},
                     of_poses.factors.data(), 1, product.factors.data());
  } else {
    for (size_t c = 0; c < sizes_.columns; ++c) {
      for (size_t j = 0; j < sizes_.factors; ++j) {
        for (size_t f = 0; f < width; ++f) {
          product.factors[c * width + f] +=
              answers_.map[c * sizes_.factors + j] * of_poses.factors[j * width + f];
        }
      }
    }
    product.error_mm += CompressionErrorMm(answers_, of_poses.factors, product.factors);
  }
  product.error_mm = std::max(product.error_mm, held_.ErrorMm(poses));
  return product;
}

void AnswerEvaluator::MoveFree(const std::vector<double>& mapped, std::vector<float>* moves) const {
  const PackedColumns& columns = answers_.columns;
  AddPackedProduct({columns.steps.data(), columns.upper.data(), columns.lower.data(), sizes_.rows,
                    sizes_.columns, sizes_.full_columns},
                   mapped.data(), sizes_.factor_width, moves->data());
}

void AnswerEvaluator::MoveClusters(const std::vector<double>& mapped,
                                   std::vector<float>* moves) const {
  const PackedColumns& columns = answers_.columns;
  size_t first_vertex = 0;
  size_t first_column = 0;
  size_t first_upper = 0;
  size_t first_lower = 0;
  std::vector<float> own;
  for (size_t k = 0; k < answers_.clusters.size(); k += 3) {
    const auto vertices = static_cast<size_t>(answers_.clusters[k]);
    const auto count = static_cast<size_t>(answers_.clusters[k + 1]);
    const auto full = static_cast<size_t>(answers_.clusters[k + 2]);
    own.assign(3 * vertices, 0.0F);
    AddPackedProduct({columns.steps.data() + first_column, columns.upper.data() + first_upper,
                      columns.lower.data() + first_lower, 3 * vertices, count, full},
                     mapped.data() + first_column, 1, own.data());
    for (size_t i = 0; i < vertices; ++i) {
      const auto vertex = static_cast<size_t>(answers_.cluster_vertices[first_vertex + i]);
      std::copy_n(own.data() + 3 * i, 3, moves->data() + 3 * vertex);
    }
    first_vertex += vertices;
    first_column += count;
    first_upper += 3 * vertices * count;
    first_lower += 3 * vertices * full;
  }
}

void AnswerEvaluator::Place(std::span<const AnswerPose> poses, const std::vector<float>& moves,
                            std::vector<float>* positions) const {
  constexpr double kZero[3] = {};
  std::vector<AnswerMotion> motions;
  for (const AnswerPose& pose : poses) motions.push_back(MotionAbout(pose, kZero));
  positions->resize(3 * answers_.regions.size());
  ForEachVertex(answers_, [&](size_t place, int32_t region, size_t first) {
    float* const at = positions->data() + 3 * place;
    for (size_t axis = 0; axis < 3; ++axis) {
      if (region == PortableAnswers::kFree) {
        at[axis] = answers_.free_rest[first + axis] + moves[first + axis];
      } else if (region == PortableAnswers::kFixed) {
        at[axis] = answers_.fixed_rest[first + axis];
      } else {
        const AnswerMotion& motion = motions[static_cast<size_t>(region)];
        const double* const rest = answers_.handle_rest.data() + first;
        const double* const row = motion.turn.data() + 3 * axis;
        at[axis] = static_cast<float>(rest[axis] + row[0] * rest[0] + row[1] * rest[1] +
                                      row[2] * rest[2] + motion.move_mm[axis]);
      }
    }
  });
}

}  // namespace tissueform
