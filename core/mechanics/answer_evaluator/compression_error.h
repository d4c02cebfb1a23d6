// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "core/mechanics/answer_evaluator/portable_answers.h"

namespace tissueform {

// How far, in mm, a free vertex of gradient_field or linear_elastic can be put off by what was cut
// of the columns, by lower halves that there are not, and by single precision. `factors`: as they
// go into the map, `mapped`: as they come out.
double CompressionErrorMm(const PortableAnswers& answers, const std::vector<double>& factors,
                          const std::vector<double>& mapped);

}  // namespace tissueform
