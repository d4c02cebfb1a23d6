// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>

#include "core/mechanics/answer_evaluator/portable_answers.h"

namespace tissueform {

bool IsModel(const PortableAnswers& answers, AnswerModel model);

// Pairs of the lip seal; 0 without one.
size_t SealPairs(const PortableAnswers& answers);

// How many there are of what is not written down by itself. REQUIRES: CheckAnswers finds nothing.
struct AnswerSizes {
  size_t handles = 0;
  size_t free = 0;           // vertices
  size_t factor_width = 1;   // numbers a column and pose
  size_t rows = 0;           // of the columns
  size_t factors = 0;        // rows of what the map is multiplied with
  size_t columns = 0;        // after the map
  size_t full_columns = 0;   // the last ones, with lower halves
  size_t nodes = 0;          // of gradient_field
  size_t contacts = 0;       // unilateral rows, of linear_elastic
  size_t seal_pairs = 0;     // of sealed lips, of linear_elastic with contact
  size_t pairs = 0;          // of neo_hookean
  size_t triples = 0;        // of neo_hookean with a third order
  size_t full_map_cols = 0;  // of neo_hookean
  size_t band_variables = 0;
};
AnswerSizes SizesOf(const PortableAnswers& answers);

}  // namespace tissueform
