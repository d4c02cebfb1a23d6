// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace tissueform {

// Where a handle goes: x = pivot + scale R (v - pivot) + translation, R the rotation by the
// vector's length about it.
struct AnswerPose {
  std::array<double, 3> rotation_vector = {};  // radians
  std::array<double, 3> pivot_mm = {};
  std::array<double, 3> translation_mm = {};
  double scale = 1;
};

// How a pose displaces v, expressed about a point p: A (v - p) + b with A = scale R - I, row-major.
struct AnswerMotion {
  std::array<double, 9> turn = {};
  std::array<double, 3> move_mm = {};  // b, what the point itself is displaced by
};

// A of a rotation vector and a scale. Exactly zero for the identity.
std::array<double, 9> TurnMinusIdentity(const std::array<double, 3>& rotation_vector, double scale);

AnswerMotion MotionAbout(const AnswerPose& pose, const double* point);

// The length of a row of so many numbers.
template <typename Number>
double RowNorm(const Number* row, size_t width) {
  double square = 0;
  for (size_t f = 0; f < width; ++f) square += double{row[f]} * double{row[f]};
  return std::sqrt(square);
}

}  // namespace tissueform
