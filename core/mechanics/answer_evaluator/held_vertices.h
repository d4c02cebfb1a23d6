// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/mechanics/answer_evaluator/answer_pose.h"
#include "core/mechanics/answer_evaluator/portable_answers.h"

namespace tissueform {

// Calls visit(place, region, first) for every vertex in the order of the answer; from `first` on
// lie its coordinates in the rest positions of its kind.
template <typename Visit>
void ForEachVertex(const PortableAnswers& answers, const Visit& visit) {
  size_t free = 0;
  size_t fixed = 0;
  size_t held = 0;
  for (size_t place = 0; place < answers.regions.size(); ++place) {
    const int32_t region = answers.regions[place];
    size_t& number = region == PortableAnswers::kFree    ? free
                     : region == PortableAnswers::kFixed ? fixed
                                                         : held;
    visit(place, region, 3 * number);
    ++number;
  }
}

// Vertices that are not free: where they can be at most, which tells what rounding does.
class HeldVertices {
 public:
  explicit HeldVertices(const PortableAnswers& answers);

  // Half a unit in the last place of the largest coordinate. REQUIRES: a pose for every handle.
  double ErrorMm(std::span<const AnswerPose> poses) const;

 private:
  struct Ball {
    std::array<double, 3> middle = {};
    double radius = 0;
    bool is_empty = true;
  };

  double largest_fixed_mm_ = 0;  // distance from zero
  std::vector<Ball> handles_;    // around the vertices of each
};

}  // namespace tissueform
