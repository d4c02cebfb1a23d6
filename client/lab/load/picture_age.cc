// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/load/picture_age.h"

#include <algorithm>
#include <cstddef>

namespace tissueform {

std::vector<double> PictureAges(double first_sent_ms, double end_ms,
                                absl::Span<const ShownFrame> frames, double step_ms) {
  std::vector<double> ages;
  double newest_sent_ms = first_sent_ms;
  size_t shown = 0;
  for (int i = 0;; ++i) {
    const double now_ms = first_sent_ms + i * step_ms;
    if (now_ms > end_ms) return ages;
    for (; shown < frames.size() && frames[shown].shown_ms <= now_ms; ++shown) {
      newest_sent_ms = std::max(newest_sent_ms, frames[shown].sent_ms);
    }
    ages.push_back(now_ms - newest_sent_ms);
  }
}

}  // namespace tissueform
