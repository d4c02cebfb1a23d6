// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/answer_evaluator/vertex_places.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

namespace tissueform {
namespace {

constexpr double kHalfUnit = 5.97e-8;  // 2^-24, and a little for what doubles lose

// Written for displacements: identity poses give rest.
void PlaceHeld(const AnswerMotion& motion, const double* rest, float* at) {
  for (size_t axis = 0; axis < 3; ++axis) {
    const double* const row = motion.turn.data() + 3 * axis;
    at[axis] = static_cast<float>(rest[axis] + (row[0] * rest[0] + row[1] * rest[1] +
                                                row[2] * rest[2] + motion.move_mm[axis]));
  }
}

// Three numbers one by one: a compiler makes a call of memmove for std::copy_n, and a head has
// thousands of them.
void PlaceFixed(const float* rest, float* at) {
  const float x = rest[0];
  const float y = rest[1];
  const float z = rest[2];
  at[0] = x;
  at[1] = y;
  at[2] = z;
}

}  // namespace

VertexPlaces::VertexPlaces(const PortableAnswers& answers)
    : handles_(static_cast<size_t>(answers.numbers.num_handles)) {
  AddPlaces(answers);
  FindBalls(answers);
  for (size_t first = 0; first < answers.fixed_rest.size(); first += 3) {
    const float* const at = answers.fixed_rest.data() + first;
    largest_fixed_mm_ =
        std::max(largest_fixed_mm_, std::hypot(double{at[0]}, double{at[1]}, double{at[2]}));
  }
}

void VertexPlaces::AddPlaces(const PortableAnswers& answers) {
  for (size_t place = 0; place < answers.regions.size(); ++place) {
    const int32_t region = answers.regions[place];
    if (region == PortableAnswers::kFixed) {
      fixed_.push_back(static_cast<int32_t>(place));
    } else if (region != PortableAnswers::kFree) {
      held_.push_back(static_cast<int32_t>(place));
    } else {
      const bool goes_on = !free_.empty() && free_.back().place + free_.back().count == place;
      if (!goes_on) free_.push_back({.place = place});
      ++free_.back().count;
      ++num_free_;
    }
  }
}

void VertexPlaces::FindBalls(const PortableAnswers& answers) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  using Corner = std::array<double, 3>;
  std::vector<Corner> low(handles_.size(), {kInfinity, kInfinity, kInfinity});
  std::vector<Corner> high(handles_.size(), {-kInfinity, -kInfinity, -kInfinity});
  for (size_t i = 0; i < held_.size(); ++i) {
    const auto h = static_cast<size_t>(answers.regions[static_cast<size_t>(held_[i])]);
    for (size_t axis = 0; axis < 3; ++axis) {
      low[h][axis] = std::min(low[h][axis], answers.handle_rest[3 * i + axis]);
      high[h][axis] = std::max(high[h][axis], answers.handle_rest[3 * i + axis]);
    }
    handles_[h].is_empty = false;
  }
  for (size_t h = 0; h < handles_.size(); ++h) {
    if (handles_[h].is_empty) continue;
    Corner half = {};
    for (size_t axis = 0; axis < 3; ++axis) {
      handles_[h].middle[axis] = 0.5 * (low[h][axis] + high[h][axis]);
      half[axis] = 0.5 * (high[h][axis] - low[h][axis]);
    }
    handles_[h].radius = RowNorm(half.data(), 3);
  }
}

void VertexPlaces::Complete(const PortableAnswers& answers, std::span<const AnswerPose> poses,
                            float* positions) const {
  // No place lies before the row that goes there, so from the last one on nothing is lost.
  size_t end = num_free_;
  for (auto run = free_.rbegin(); run != free_.rend(); ++run) {
    end -= run->count;
    std::memmove(positions + 3 * run->place, positions + 3 * end, 3 * run->count * sizeof(float));
  }
  for (size_t i = 0; i < fixed_.size(); ++i) {
    PlaceFixed(answers.fixed_rest.data() + 3 * i, positions + 3 * static_cast<size_t>(fixed_[i]));
  }
  constexpr double kZero[3] = {};
  std::vector<AnswerMotion> motions;
  motions.reserve(poses.size());
  for (const AnswerPose& pose : poses) motions.push_back(MotionAbout(pose, kZero));
  for (size_t i = 0; i < held_.size(); ++i) {
    const auto place = static_cast<size_t>(held_[i]);
    PlaceHeld(motions[static_cast<size_t>(answers.regions[place])],
              answers.handle_rest.data() + 3 * i, positions + 3 * place);
  }
}

void VertexPlaces::PlaceOne(const PortableAnswers& answers, std::span<const AnswerPose> poses,
                            int32_t region, size_t rank, float* position) {
  if (region == PortableAnswers::kFixed) {
    PlaceFixed(answers.fixed_rest.data() + 3 * rank, position);
    return;
  }
  constexpr double kZero[3] = {};
  PlaceHeld(MotionAbout(poses[static_cast<size_t>(region)], kZero),
            answers.handle_rest.data() + 3 * rank, position);
}

double VertexPlaces::ErrorMm(std::span<const AnswerPose> poses) const {
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

size_t VertexPlaces::bytes_held() const {
  return free_.size() * sizeof(Run) + (fixed_.size() + held_.size()) * sizeof(int32_t) +
         handles_.size() * sizeof(Ball);
}

}  // namespace tissueform
