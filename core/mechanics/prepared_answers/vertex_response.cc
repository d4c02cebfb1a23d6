// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/vertex_response.h"

#include <algorithm>
#include <utility>

#include "core/mechanics/answer_evaluator/basic_answer_evaluator.h"

namespace tissueform {

template class BasicAnswerEvaluator<PanelMatrix>;

std::vector<AnswerPose> ToAnswerPoses(absl::Span<const HandlePose> poses) {
  std::vector<AnswerPose> converted(poses.size());
  for (size_t h = 0; h < poses.size(); ++h) {
    for (size_t axis = 0; axis < 3; ++axis) {
      const auto i = static_cast<Eigen::Index>(axis);
      converted[h].rotation_vector[axis] = poses[h].rotation_vector[i];
      converted[h].pivot_mm[axis] = poses[h].pivot_mm[i];
      converted[h].translation_mm[axis] = poses[h].translation_mm[i];
    }
    converted[h].scale = poses[h].scale;
  }
  return converted;
}

VertexResponse::VertexResponse(PortableAnswers answers, int num_terms_before)
    : evaluator_(std::move(answers)), num_terms_before_(num_terms_before) {}

double VertexResponse::ErrorBoundMm(absl::Span<const HandlePose> poses) const {
  return evaluator_.ErrorMm(ToAnswerPoses(poses));
}

TouchForces VertexResponse::TouchForcesAt(absl::Span<const HandlePose> poses) const {
  return evaluator_.TouchForcesAt(ToAnswerPoses(poses));
}

bool VertexResponse::error_is_estimate() const {
  return IsModel(evaluator_.answers(), AnswerModel::kNeoHookean);
}

bool VertexResponse::Covers(absl::Span<const HandlePose> poses) const {
  return evaluator_.Covers(ToAnswerPoses(poses));
}

void VertexResponse::Evaluate(absl::Span<const HandlePose> poses, FloatPositions* positions) const {
  positions->resize(num_vertices(), 3);
  evaluator_.Evaluate(ToAnswerPoses(poses), positions->data());
}

std::optional<double> VertexResponse::Answer(absl::Span<const HandlePose> poses,
                                             FloatPositions* positions) const {
  positions->resize(num_vertices(), 3);
  double error_mm = 0;
  if (!evaluator_.Answer(ToAnswerPoses(poses), positions->data(), &error_mm)) return std::nullopt;
  return error_mm;
}

PortableAnswers VertexResponse::Describe() const {
  PortableAnswers answers = evaluator_.answers();
  answers.columns = {};
  answers.cluster_map = {};
  for (const PanelMatrix& columns : evaluator_.free_vertices().columns()) {
    columns.Unpack(&answers.columns);
  }
  evaluator_.free_vertices().map().Unpack(&answers.cluster_map);
  return answers;
}

Eigen::Index VertexResponse::num_vertices() const {
  return static_cast<Eigen::Index>(evaluator_.answers().regions.size());
}

int VertexResponse::num_terms() const {
  size_t entries = 0;
  for (const PanelMatrix& columns : evaluator_.free_vertices().columns()) {
    if (columns.rows() == evaluator_.sizes().rows) return static_cast<int>(columns.columns());
    entries += columns.rows() * columns.columns();
  }
  const size_t rows = std::max<size_t>(evaluator_.sizes().rows, 1);
  return static_cast<int>((entries + rows - 1) / rows);
}

}  // namespace tissueform
