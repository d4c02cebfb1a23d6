// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <optional>

#include "absl/types/span.h"

#include "core/base/types.h"
#include "core/mechanics/answer_evaluator/portable_answers.h"
#include "core/mechanics/constraints/handle_pose.h"

namespace tissueform {

// Answers of a linear-in-its-columns model at chosen vertices without a back-substitution: a small
// dense product of prepared columns with coefficients that depend on the poses only (the response
// basis of the gradient field, the 12 columns a handle of linear elasticity). Single precision.
// Only free vertices have columns; fixed ones rest, and those of handles are where the poses put
// them (ChosenVertices).
//
// Constant: any number of threads may ask at once.
class VertexResponse {
 public:
  virtual ~VertexResponse() = default;

  // Bound, in mm, of how far any chosen vertex may lie from the model's direct answer to these
  // poses: truncation and single precision together. Cheap: does not depend on the number of
  // vertices.
  //
  // REQUIRES: one legal pose per handle.
  virtual double ErrorBoundMm(absl::Span<const HandlePose> poses) const = 0;

  // Whether what is called a bound here is an estimate: of models whose error nobody can bound.
  virtual bool error_is_estimate() const { return false; }

  // Whether the bound is within the tolerance that was asked for, and the poses within the prepared
  // range. Otherwise use the direct solve.
  virtual bool Covers(absl::Span<const HandlePose> poses) const = 0;

  // Writes the positions of the chosen vertices in their order, resized.
  virtual void Evaluate(absl::Span<const HandlePose> poses, FloatPositions* positions) const = 0;

  // The three in one, which is what a frame costs: the bound, with `positions` written, or nothing
  // when the poses are not covered.
  virtual std::optional<double> Answer(absl::Span<const HandlePose> poses,
                                       FloatPositions* positions) const = 0;

  // All that AnswerEvaluator, or a program that is not ours, needs to give the same answers; see
  // docs/prepared-answers.md. Copies: as large as what is held.
  virtual PortableAnswers Describe() const = 0;

  virtual Eigen::Index num_vertices() const = 0;
  virtual int num_terms() const = 0;         // columns of the product, all handles together
  virtual int num_terms_before() const = 0;  // before they were compressed to the tolerance
  virtual int64_t bytes_held() const = 0;
};

}  // namespace tissueform
