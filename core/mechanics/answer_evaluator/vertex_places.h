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

// Where the vertices of an answer stand in it: the free ones, which alone have rows in the columns;
// the fixed ones, which rest; those of handles, which their poses move, in double precision and
// rounded once. Nearly half of a head's skin is not free.
//
// Constant: any number of threads may ask at once. Every call takes the answers that it was made
// from.
class VertexPlaces {
 public:
  explicit VertexPlaces(const PortableAnswers& answers);

  // `positions`, x y z of all vertices, begin with the free ones: they go to their places, and all
  // others to theirs. REQUIRES: a pose for every handle.
  void Complete(const PortableAnswers& answers, std::span<const AnswerPose> poses,
                float* positions) const;

  // Where a vertex is that is not free, by its rank among the fixed ones or those of handles.
  static void PlaceOne(const PortableAnswers& answers, std::span<const AnswerPose> poses,
                       int32_t region, size_t rank, float* position);

  // How far, in mm, a vertex that is not free can lie from where it should be: half a unit in the
  // last place of the largest coordinate. REQUIRES: a pose for every handle.
  double ErrorMm(std::span<const AnswerPose> poses) const;

  // Calls visit(place, number) for every free vertex, `number` counting them.
  template <typename Visit>
  void ForEachFree(const Visit& visit) const {
    size_t number = 0;
    for (const Run& run : free_) {
      for (size_t i = 0; i < run.count; ++i) visit(run.place + i, number++);
    }
  }

  size_t num_free() const { return num_free_; }
  size_t bytes_held() const;

 private:
  // Neighbors in the answer that are free.
  struct Run {
    size_t place = 0;  // of the first
    size_t count = 0;
  };
  // Around a handle's vertices: about the middle of their box, but any would do.
  struct Ball {
    std::array<double, 3> middle = {};
    double radius = 0;
    bool is_empty = true;
  };

  void AddPlaces(const PortableAnswers& answers);
  void FindBalls(const PortableAnswers& answers);

  size_t num_free_ = 0;
  std::vector<Run> free_;        // rising, as are the others
  std::vector<int32_t> fixed_;   // places
  std::vector<int32_t> held_;    // places, of all handles
  double largest_fixed_mm_ = 0;  // distance from zero
  std::vector<Ball> handles_;
};

}  // namespace tissueform
