// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/mechanics/answer_evaluator/answer_pose.h"
#include "core/mechanics/answer_evaluator/answer_sizes.h"
#include "core/mechanics/answer_evaluator/contact_forces.h"
#include "core/mechanics/answer_evaluator/free_vertices.h"
#include "core/mechanics/answer_evaluator/packed_matrix.h"
#include "core/mechanics/answer_evaluator/portable_answers.h"
#include "core/mechanics/answer_evaluator/vertex_places.h"

namespace tissueform {

template <typename Matrix>
class BasicAnswerEvaluator;

// Of the bytes as they come, for clients and browsers.
using AnswerEvaluator = BasicAnswerEvaluator<PackedMatrix>;

// What AnswerEvaluator::Answer writes of chosen vertices (AnswerEvaluator::Choose), 3 numbers each,
// the same to the bit; false likewise. Costs the factors of the poses and little for each vertex.
bool AnswerAt(const AnswerEvaluator& evaluator, std::span<const AnswerPose> poses,
              std::span<const ChosenVertex> chosen, float* positions);

// Prepared answers at work, by the standard library alone: everywhere they are evaluated by this,
// on servers (VertexResponse) with another `Matrix`, which keeps entries as its processor likes
// them and reads as much of them as the tolerance needs. Two that read differently differ by less
// than their errors together.
//
// Constant: any number of threads may ask at once.
template <typename Matrix>
class BasicAnswerEvaluator {
 public:
  // REQUIRES: CheckAnswers finds nothing; so it is with what ReadAnswers gives.
  explicit BasicAnswerEvaluator(PortableAnswers answers);
  // Matrices may be views of the answers, which stay where they are when they are moved.
  BasicAnswerEvaluator(BasicAnswerEvaluator&&) noexcept = default;
  BasicAnswerEvaluator& operator=(BasicAnswerEvaluator&&) noexcept = default;

  // Without the entries of columns where `Matrix` keeps them.
  const PortableAnswers& answers() const { return answers_; }
  const AnswerSizes& sizes() const { return sizes_; }
  const FreeVertices<Matrix>& free_vertices() const { return free_; }

  // The error of the positions in mm: a bound, or of neo_hookean an estimate. Infinite unless there
  // is a pose for every handle, with a positive scale and numbers up to 1e6 (rad, scale) or 1e9 mm.
  double ErrorMm(std::span<const AnswerPose> poses) const;

  // Whether the poses are in the prepared range and the error is within what was asked for.
  bool Covers(std::span<const AnswerPose> poses) const;

  // Writes x y z in mm of every vertex in single precision, 3 numbers each. False, with no
  // position written, where the poses are not covered. `error_mm` may be null; otherwise ErrorMm is
  // written.
  bool Answer(std::span<const AnswerPose> poses, float* positions, double* error_mm) const;
  // The same; resized.
  bool Answer(std::span<const AnswerPose> poses, std::vector<float>* positions,
              double* error_mm = nullptr) const;

  // Where vertices of an answer are found, by their numbers in it. REQUIRES: numbers in [0, number
  // of vertices).
  std::vector<ChosenVertex> Choose(std::span<const int32_t> vertices) const;

  // The same of poses that need not be covered. REQUIRES: legal poses (AreLegal).
  void Evaluate(std::span<const AnswerPose> poses, float* positions) const;

  // Whether there are columns of the band of uncertainty.
  bool has_band() const { return sizes_.band_variables > 0; }

  // Writes of every vertex the distance in mm within which it stays in 95 of 100 cases if nothing
  // but the material is in doubt; resized. False, with nothing written, without columns of the
  // band, where there is no pose for every handle, and where one turns too far for a band
  // (HasBand).
  bool Band(std::span<const AnswerPose> poses, std::vector<float>* band_mm) const;

  // Forces of the unilateral contact rows, in the order of the session's rows, and of the lip seal.
  // Nothing without such rows, and unless the poses are legal (AreLegal). Costs what the contact of
  // an answer costs.
  TouchForces TouchForcesAt(std::span<const AnswerPose> poses) const;

  size_t bytes_held() const;

 private:
  friend bool AnswerAt(const AnswerEvaluator& evaluator, std::span<const AnswerPose> poses,
                       std::span<const ChosenVertex> chosen, float* positions);

  // Of a pose of every handle.
  struct Product {
    std::vector<double> factors;  // of the compressed columns
    ColumnReading reading;
    double error_mm = 0;
  };

  // Of poses that may be anything: an infinite error unless they are legal.
  Product CheckedProductOf(std::span<const AnswerPose> poses) const;
  // REQUIRES: legal poses.
  Product ProductOf(std::span<const AnswerPose> poses) const;
  void Write(std::span<const AnswerPose> poses, const Product& product, float* positions) const;

  PortableAnswers answers_;
  AnswerSizes sizes_;
  VertexPlaces places_;
  ContactForces contact_;
  FreeVertices<Matrix> free_;
};

}  // namespace tissueform
