// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/answer_evaluator/answer_pose.h"

#include <cmath>

namespace tissueform {

std::array<double, 9> TurnMinusIdentity(const std::array<double, 3>& rotation_vector,
                                        double scale) {
  const double angle = RowNorm(rotation_vector.data(), 3);
  std::array<double, 9> turn = {scale - 1, 0, 0, 0, scale - 1, 0, 0, 0, scale - 1};
  if (angle == 0) return turn;
  const std::array<double, 3> k = {rotation_vector[0] / angle, rotation_vector[1] / angle,
                                   rotation_vector[2] / angle};
  // By the half angle: 1 - cos(angle) itself would lose digits.
  const double sine_of_half = std::sin(angle / 2);
  const double sine = scale * 2 * sine_of_half * std::cos(angle / 2);
  const double versine = scale * 2 * sine_of_half * sine_of_half;
  const std::array<double, 9> cross = {0, -k[2], k[1], k[2], 0, -k[0], -k[1], k[0], 0};
  for (size_t i = 0; i < 3; ++i) {
    for (size_t j = 0; j < 3; ++j) {
      turn[3 * i + j] += sine * cross[3 * i + j] + versine * (k[i] * k[j] - (i == j ? 1 : 0));
    }
  }
  return turn;
}

AnswerMotion MotionAbout(const AnswerPose& pose, const double* point) {
  AnswerMotion motion = {TurnMinusIdentity(pose.rotation_vector, pose.scale), pose.translation_mm};
  for (size_t i = 0; i < 3; ++i) {
    for (size_t j = 0; j < 3; ++j) {
      motion.move_mm[i] += motion.turn[3 * i + j] * (point[j] - pose.pivot_mm[j]);
    }
  }
  return motion;
}

}  // namespace tissueform
