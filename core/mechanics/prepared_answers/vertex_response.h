// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "absl/types/span.h"

#include "core/base/types.h"
#include "core/mechanics/answer_evaluator/answer_evaluator.h"
#include "core/mechanics/answer_evaluator/portable_answers.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/prepared_answers/panel_matrix.h"

namespace tissueform {

extern template class BasicAnswerEvaluator<PanelMatrix>;

// Answers of a linear-in-its-columns model at chosen vertices without a back-substitution: a small
// dense product of prepared columns with coefficients that depend on the poses only (the response
// basis of the gradient field, the 12 columns a handle of linear elasticity). Single precision.
// Only free vertices have columns; fixed ones rest, and those of handles are where the poses put
// them. The server's side of BasicAnswerEvaluator.
//
// Constant: any number of threads may ask at once. REQUIRES of all poses: one legal pose per
// handle.
class VertexResponse {
 public:
  // `num_terms_before`: columns of the product before they were compressed.
  VertexResponse(PortableAnswers answers, int num_terms_before);

  // Bound, in mm, of how far any chosen vertex may lie from the model's direct answer to these
  // poses: truncation and single precision together. Cheap: does not depend on the number of
  // vertices.
  double ErrorBoundMm(absl::Span<const HandlePose> poses) const;

  // Whether what is called a bound here is an estimate: for models whose error has no known bound.
  bool error_is_estimate() const;

  // Whether the bound is within the tolerance that was asked for, and the poses within the prepared
  // range. Otherwise use the direct solve.
  bool Covers(absl::Span<const HandlePose> poses) const;

  // Writes the positions of the chosen vertices in their order, resized.
  void Evaluate(absl::Span<const HandlePose> poses, FloatPositions* positions) const;

  // The three in one, which is what a frame costs: the bound, with `positions` written, resized, or
  // nothing when the poses are not covered.
  std::optional<double> Answer(absl::Span<const HandlePose> poses, FloatPositions* positions) const;

  // As AnswerEvaluator has them.
  TouchForces TouchForcesAt(absl::Span<const HandlePose> poses) const;

  // All that AnswerEvaluator, or a program that is not ours, needs to give the same answers; see
  // docs/prepared-answers.md. Copies: as large as what is held.
  PortableAnswers Describe() const;

  Eigen::Index num_vertices() const;
  // Columns of the product, all handles together; of clusters the mean over the vertices, rounded
  // up.
  int num_terms() const;
  int num_terms_before() const { return num_terms_before_; }
  int64_t bytes_held() const { return static_cast<int64_t>(evaluator_.bytes_held()); }

 private:
  BasicAnswerEvaluator<PanelMatrix> evaluator_;
  int num_terms_before_;
};

std::vector<AnswerPose> ToAnswerPoses(absl::Span<const HandlePose> poses);

}  // namespace tissueform
