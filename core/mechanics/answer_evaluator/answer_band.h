// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <span>
#include <vector>

#include "core/mechanics/answer_evaluator/answer_pose.h"
#include "core/mechanics/answer_evaluator/portable_answers.h"

namespace tissueform {

// Of each free vertex the 95th percentile of the distance in mm that its answer lies off for the
// material's sake, in first order. REQUIRES: columns of the band; legal poses.
std::vector<float> BandOfFree(const PortableAnswers& answers, std::span<const AnswerPose> poses);

}  // namespace tissueform
