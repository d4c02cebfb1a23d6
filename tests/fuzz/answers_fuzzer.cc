// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cmath>
#include <cstdlib>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/mechanics/answer_evaluator/answer_bytes.h"
#include "core/mechanics/answer_evaluator/answer_evaluator.h"
#include "tests/fuzz/fuzz_target.h"

namespace tissueform::fuzz {

void FuzzAnswers(const uint8_t* data, size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  AnswerReading reading = ReadAnswers(bytes);
  if ((reading.error == AnswerError::kNone) != reading.message.empty()) std::abort();
  if (reading.error != AnswerError::kNone) return;
  // What was understood can be said again.
  const std::string again = WriteAnswers(reading.answers);
  if (ReadAnswers(again).error != AnswerError::kNone) std::abort();
  const size_t vertices = reading.answers.regions.size();
  const AnswerEvaluator evaluator(std::move(reading.answers));
  std::vector<AnswerPose> poses(static_cast<size_t>(evaluator.answers().numbers.num_handles));
  for (const double amount : {0.0, 0.1, 1e6}) {
    for (AnswerPose& pose : poses) {
      pose.rotation_vector = {amount, 0, -amount};
      pose.translation_mm = {0, amount, 0};
    }
    std::vector<float> positions;
    double error_mm = 0;
    if (!evaluator.Answer(poses, &positions, &error_mm)) continue;
    if (positions.size() != 3 * vertices || !std::isfinite(error_mm)) std::abort();
  }
}

}  // namespace tissueform::fuzz
