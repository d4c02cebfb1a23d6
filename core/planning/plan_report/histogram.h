// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/planning/rendering/panels.h"

namespace tissueform {

// How many values lie in each of a row of bins of one width.
struct Histogram {
  double low = 0;
  double bin_width = 1;
  // Bin b holds [low + b * bin_width, low + (b + 1) * bin_width); the first and the last one also
  // what lies beyond them.
  std::vector<int64_t> counts;
};

// REQUIRES: num_bins > 0, bin_width > 0.
Histogram CountInBins(const std::vector<double>& values, double low, double bin_width,
                      int num_bins);

// Its outline, in percent of all values but no less than `floor_percent`, which a logarithmic axis
// needs.
Curve HistogramCurve(const Histogram& histogram, std::string name, const Colour& colour,
                     double floor_percent = 0);

}  // namespace tissueform
