// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "core/mechanics/answer_evaluator/portable_answers.h"

namespace tissueform {

// What is wrong with answers that come from outside, one line; empty when nothing is: then all
// sizes fit together, all numbers are finite and in range, and every index is one.
std::string CheckAnswers(const PortableAnswers& answers);

}  // namespace tissueform
