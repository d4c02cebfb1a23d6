// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/answer_evaluator/answer_sizes.h"

namespace tissueform {

bool IsModel(const PortableAnswers& answers, AnswerModel model) {
  return answers.numbers.model == static_cast<double>(model);
}

size_t SealPairs(const PortableAnswers& answers) {
  return answers.seal_upper_map.size() / (12 * static_cast<size_t>(answers.numbers.num_handles));
}

AnswerSizes SizesOf(const PortableAnswers& answers) {
  AnswerSizes sizes;
  sizes.handles = static_cast<size_t>(answers.numbers.num_handles);
  sizes.free = answers.free_rest.size() / 3;
  sizes.columns = answers.columns.steps.size();
  const bool is_gradient = IsModel(answers, AnswerModel::kGradientField);
  sizes.factor_width = is_gradient ? 3 : 1;
  sizes.rows = is_gradient ? sizes.free : 3 * sizes.free;
  if (is_gradient) {
    sizes.nodes = answers.nodes.size() / sizes.handles;
    sizes.factors = 3 * static_cast<size_t>(answers.numbers.num_polynomials) + 4 * sizes.handles;
  } else {
    sizes.contacts = answers.contact_gaps.size();
    sizes.seal_pairs = SealPairs(answers);
    sizes.factors = 12 * sizes.handles + sizes.contacts + sizes.seal_pairs;
  }
  if (IsModel(answers, AnswerModel::kNeoHookean)) {
    const size_t numbers = 6 * sizes.handles;
    sizes.pairs = numbers * (numbers + 1) / 2;
    if (!answers.third_lengths.empty()) sizes.triples = sizes.pairs * (numbers + 2) / 3;
    sizes.factors += sizes.pairs + sizes.triples;
    if (sizes.columns > 0) sizes.full_map_cols = answers.cluster_map.lower.size() / sizes.columns;
  } else if (sizes.rows > 0) {
    sizes.full_columns = answers.columns.lower.size() / sizes.rows;
  }
  if (const size_t band_columns = answers.band.steps.size(); band_columns > 0 && sizes.free > 0) {
    sizes.band_variables = answers.band.upper.size() / band_columns / sizes.free / 3;
  }
  return sizes;
}

}  // namespace tissueform
