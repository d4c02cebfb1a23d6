// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/answer_evaluator/answer_evaluator.h"

#include "core/mechanics/answer_evaluator/basic_answer_evaluator.h"

namespace tissueform {

template class BasicAnswerEvaluator<PackedMatrix>;

bool AnswerAt(const AnswerEvaluator& evaluator, std::span<const AnswerPose> poses,
              std::span<const ChosenVertex> chosen, float* positions) {
  const PortableAnswers& answers = evaluator.answers();
  const AnswerEvaluator::Product product = evaluator.CheckedProductOf(poses);
  if (!AreCovered(answers, poses, product.error_mm)) return false;
  for (const ChosenVertex& vertex : chosen) {
    if (vertex.region == PortableAnswers::kFree) {
      evaluator.free_.MoveOne(answers, evaluator.sizes_, product.factors, vertex, positions);
    } else {
      VertexPlaces::PlaceOne(answers, poses, vertex.region, vertex.rank, positions);
    }
    positions += 3;
  }
  return true;
}

}  // namespace tissueform
