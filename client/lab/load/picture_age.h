// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "absl/types/span.h"

namespace tissueform {

// A frame that a drag has shown. Times on one clock.
struct ShownFrame {
  double sent_ms = 0;   // when the pose that it answers was sent
  double shown_ms = 0;  // when its positions were there
};

// How old the picture of a drag was, every `step_ms` from the first pose on until `end_ms`: now
// minus the send time of the newest pose that is shown, and before any is shown, minus that of the
// first pose. What a user feels: poses that were dropped count, which the latency of the frames
// that came does not show.
//
// `frames` in the order in which they were shown.
std::vector<double> PictureAges(double first_sent_ms, double end_ms,
                                absl::Span<const ShownFrame> frames, double step_ms = 10);

}  // namespace tissueform
