// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <span>

#include "core/mechanics/answer_evaluator/answer_pose.h"
#include "core/mechanics/answer_evaluator/portable_answers.h"

namespace tissueform {

// Whether there is a pose for every handle, with a positive scale, and with numbers so far from
// overflowing (1e6 rad, 1e9 mm, a scale of 1e6) that positions are finite.
bool AreLegal(const PortableAnswers& answers, std::span<const AnswerPose> poses);

// Whether legal poses with that error are answered: within the prepared range, and the error within
// what was asked for. The edge of the range belongs to it.
bool AreCovered(const PortableAnswers& answers, std::span<const AnswerPose> poses, double error_mm);

// Beyond this turn there is no band, regardless of the request. It is of first order in linear
// elasticity, which takes a turn by a for a strain of 1 - cos(a): 13 % here, as much as tissue is
// strained by an operation. What stiffness does to that strain says nothing about the face.
inline constexpr double kLargestBandRotationRad = 0.524;  // 30 degrees

// Whether a handle that turns so far has a band in answers that were prepared for turns up to
// `max_rotation_rad`: beyond these neither what was cut of its columns is bounded.
bool HasBand(double rotation_rad, double max_rotation_rad);

}  // namespace tissueform
