// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/answer_evaluator/pose_range.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/mechanics/answer_evaluator/answer_sizes.h"

namespace tissueform {
namespace {

// Of poses, those of CheckPose: far beyond any head.
constexpr double kLargestAngle = 1e6;
constexpr double kLargestLengthMm = 1e9;
constexpr double kLargestScale = 1e6;
constexpr double kRangeSlack = 1e-9;

// False for what is not a number, too.
bool IsWithin(const std::array<double, 3>& v, double most) {
  return std::abs(v[0]) <= most && std::abs(v[1]) <= most && std::abs(v[2]) <= most;
}

}  // namespace

bool AreLegal(const PortableAnswers& answers, std::span<const AnswerPose> poses) {
  return static_cast<double>(poses.size()) == answers.numbers.num_handles &&
         std::all_of(poses.begin(), poses.end(), [](const AnswerPose& pose) {
           return IsWithin(pose.rotation_vector, kLargestAngle) &&
                  IsWithin(pose.pivot_mm, kLargestLengthMm) &&
                  IsWithin(pose.translation_mm, kLargestLengthMm) && pose.scale > 0 &&
                  pose.scale <= kLargestScale;
         });
}

bool AreCovered(const PortableAnswers& answers, std::span<const AnswerPose> poses,
                double error_mm) {
  const AnswerNumbers& numbers = answers.numbers;
  // Nothing is truncated there: digits alone limit how far poses may go.
  if (IsModel(answers, AnswerModel::kLinearElastic)) return error_mm <= numbers.tolerance_mm;
  const bool is_neo = IsModel(answers, AnswerModel::kNeoHookean);
  const bool in_range = std::all_of(poses.begin(), poses.end(), [&](const AnswerPose& pose) {
    const double angle = RowNorm(pose.rotation_vector.data(), 3);
    const bool keeps_size =
        is_neo ? pose.scale == 1
               : std::abs(pose.scale - 1) <= numbers.max_scale_change + kRangeSlack;
    return keeps_size && angle <= numbers.max_rotation_rad * (1 + kRangeSlack);
  });
  return in_range && error_mm <= (is_neo ? numbers.max_estimate_mm : numbers.tolerance_mm);
}

bool HasBand(double rotation_rad, double max_rotation_rad) {
  return rotation_rad <= std::min(max_rotation_rad, kLargestBandRotationRad) * (1 + kRangeSlack);
}

}  // namespace tissueform
