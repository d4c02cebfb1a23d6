// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "absl/types/span.h"

#include "core/base/types.h"
#include "core/mechanics/answer_evaluator/portable_answers.h"
#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/constraints/handle_pose.h"

namespace tissueform {

// The vertices that a prepared answer gives, in their order: the free ones, which alone have rows
// in its columns; the fixed ones, which stay where they are; those of handles, which their poses
// move, in double precision and rounded once. Nearly half of a head's skin is not free.
//
// Constant: any number of threads may ask at once.
class ChosenVertices {
 public:
  // `rest`: of all vertices of the mesh. A vertex may come more than once. REQUIRES: `vertices` in
  // [0, #V).
  ChosenVertices(const Positions& rest, const ConstraintSet& constraints,
                 const std::vector<int32_t>& vertices);

  // Of `vertices`, those that the object was made of, the free ones.
  std::vector<int32_t> FreeAmong(const std::vector<int32_t>& vertices) const;

  // `positions`, size() by 3, holds the free ones in its first rows: they go to their places, and
  // all others to theirs. REQUIRES: one legal pose per handle.
  void Complete(absl::Span<const HandlePose> poses, FloatPositions* positions) const;

  // How far, in mm, a vertex that is not free can lie from where it should be: half a unit in the
  // last place of the largest coordinate.
  double RoundingBoundMm(absl::Span<const HandlePose> poses) const;

  // Writes how many vertices and handles there are, regions, and the rest of all but free ones.
  void Describe(PortableAnswers* answers) const;

  Eigen::Index size() const { return size_; }
  Eigen::Index num_free() const { return num_free_; }
  int64_t bytes_held() const;

 private:
  // Neighbours in the answer that are free.
  struct Run {
    int32_t place = 0;  // of the first, in the answer
    int32_t count = 0;
  };
  struct Handle {
    std::vector<int32_t> places;
    Positions rest;
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();  // of a ball around them
    double radius = 0;
  };

  Eigen::Index size_ = 0;
  Eigen::Index num_free_ = 0;
  std::vector<Run> free_;  // rising
  std::vector<int32_t> fixed_places_;
  FloatPositions fixed_rest_;
  double largest_fixed_ = 0;     // distance of a vertex from zero
  std::vector<Handle> handles_;  // all of the constraint set's; some may have no vertex here
};

}  // namespace tissueform
