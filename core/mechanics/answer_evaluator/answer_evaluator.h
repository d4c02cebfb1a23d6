// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <span>
#include <vector>

#include "core/mechanics/answer_evaluator/answer_pose.h"
#include "core/mechanics/answer_evaluator/answer_sizes.h"
#include "core/mechanics/answer_evaluator/held_vertices.h"
#include "core/mechanics/answer_evaluator/portable_answers.h"

namespace tissueform {

// Prepared answers without what made them: the same positions as VertexResponse gives, by the
// standard library alone. Reads all of the columns where a server reads as much as its tolerance
// needs, so the two differ by less than their errors together.
//
// Constant: any number of threads may ask at once.
class AnswerEvaluator {
 public:
  // REQUIRES: CheckAnswers finds nothing; so it is with what ReadAnswers gives.
  explicit AnswerEvaluator(PortableAnswers answers);

  const PortableAnswers& answers() const { return answers_; }

  // The error of the positions in mm: a bound, or of neo_hookean an estimate. Infinite unless there
  // is a pose for every handle, with a positive scale and numbers up to 1e6 (rad, scale) or 1e9 mm.
  double ErrorMm(std::span<const AnswerPose> poses) const;

  // Whether the poses are in the prepared range and the error is within what was asked for.
  bool Covers(std::span<const AnswerPose> poses) const;

  // Writes x y z in mm of every vertex in single precision; resized. False, with no position
  // written, where the poses are not covered. `error_mm` may be null; otherwise ErrorMm is written.
  bool Answer(std::span<const AnswerPose> poses, std::vector<float>* positions,
              double* error_mm = nullptr) const;

  // Whether there are columns of the band of uncertainty.
  bool has_band() const { return sizes_.band_variables > 0; }

  // Writes of every vertex the distance in mm within which it stays in 95 of 100 cases if nothing
  // but the material is in doubt; resized. False, with nothing written, without columns of the
  // band, where there is no pose for every handle, and where one turns too far for a band
  // (HasBand).
  bool Band(std::span<const AnswerPose> poses, std::vector<float>* band_mm) const;

 private:
  // Of a pose of every handle.
  struct Product {
    std::vector<double> factors;  // of the compressed columns
    double error_mm = 0;
  };

  Product ProductOf(std::span<const AnswerPose> poses) const;
  void MoveFree(const std::vector<double>& mapped, std::vector<float>* moves) const;
  void MoveClusters(const std::vector<double>& mapped, std::vector<float>* moves) const;
  void Place(std::span<const AnswerPose> poses, const std::vector<float>& moves,
             std::vector<float>* positions) const;

  PortableAnswers answers_;
  AnswerSizes sizes_;
  HeldVertices held_;
};

}  // namespace tissueform
