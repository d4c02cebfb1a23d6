// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/answer_evaluator/held_vertices.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tissueform {
namespace {

constexpr double kHalfUnit = 5.97e-8;  // 2^-24, and a little for what doubles lose

}  // namespace

HeldVertices::HeldVertices(const PortableAnswers& answers)
    : handles_(static_cast<size_t>(answers.numbers.num_handles)) {
  // Any ball around them will do: about the middle of their box.
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  using Corner = std::array<double, 3>;
  std::vector<Corner> low(handles_.size(), {kInfinity, kInfinity, kInfinity});
  std::vector<Corner> high(handles_.size(), {-kInfinity, -kInfinity, -kInfinity});
  ForEachVertex(answers, [&](size_t /*place*/, int32_t region, size_t first) {
    if (region < 0) return;
    const auto h = static_cast<size_t>(region);
    for (size_t axis = 0; axis < 3; ++axis) {
      low[h][axis] = std::min(low[h][axis], answers.handle_rest[first + axis]);
      high[h][axis] = std::max(high[h][axis], answers.handle_rest[first + axis]);
    }
    handles_[h].is_empty = false;
  });
  for (size_t h = 0; h < handles_.size(); ++h) {
    if (handles_[h].is_empty) continue;
    Corner half = {};
    for (size_t axis = 0; axis < 3; ++axis) {
      handles_[h].middle[axis] = 0.5 * (low[h][axis] + high[h][axis]);
      half[axis] = 0.5 * (high[h][axis] - low[h][axis]);
    }
    handles_[h].radius = RowNorm(half.data(), 3);
  }
  for (size_t first = 0; first < answers.fixed_rest.size(); first += 3) {
    const float* const at = answers.fixed_rest.data() + first;
    largest_fixed_mm_ =
        std::max(largest_fixed_mm_, std::hypot(double{at[0]}, double{at[1]}, double{at[2]}));
  }
}

double HeldVertices::ErrorMm(std::span<const AnswerPose> poses) const {
  double largest = largest_fixed_mm_;
  for (size_t h = 0; h < handles_.size(); ++h) {
    const Ball& ball = handles_[h];
    if (ball.is_empty) continue;
    std::array<double, 3> moved = MotionAbout(poses[h], ball.middle.data()).move_mm;
    for (size_t axis = 0; axis < 3; ++axis) moved[axis] += ball.middle[axis];
    largest = std::max(largest, RowNorm(moved.data(), 3) + poses[h].scale * ball.radius);
  }
  return kHalfUnit * largest;
}

}  // namespace tissueform
