// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/answer_evaluator/answer_evaluator.h"

#include "core/mechanics/answer_evaluator/basic_answer_evaluator.h"

namespace tissueform {

template class BasicAnswerEvaluator<PackedMatrix>;

}  // namespace tissueform
