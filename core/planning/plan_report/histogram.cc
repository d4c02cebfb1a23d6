// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/histogram.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace tissueform {

Histogram CountInBins(const std::vector<double>& values, double low, double bin_width,
                      int num_bins) {
  Histogram histogram{low, bin_width, std::vector<int64_t>(static_cast<size_t>(num_bins), 0)};
  for (const double value : values) {
    const double bin = std::clamp(std::floor((value - low) / bin_width), 0.0, num_bins - 1.0);
    ++histogram.counts[static_cast<size_t>(bin)];
  }
  return histogram;
}

Curve HistogramCurve(const Histogram& histogram, std::string name, const Colour& colour,
                     double floor_percent) {
  const auto all = std::accumulate(histogram.counts.begin(), histogram.counts.end(), int64_t{0});
  const double percent = all == 0 ? 0 : 100.0 / static_cast<double>(all);
  Curve curve{
      .name = std::move(name), .x = {histogram.low}, .y = {floor_percent}, .colour = colour};
  double edge = histogram.low;
  for (const int64_t count : histogram.counts) {
    const double height = std::max(floor_percent, percent * static_cast<double>(count));
    curve.x.insert(curve.x.end(), {edge, edge + histogram.bin_width});
    curve.y.insert(curve.y.end(), {height, height});
    edge += histogram.bin_width;
  }
  curve.x.push_back(edge);
  curve.y.push_back(floor_percent);
  return curve;
}

}  // namespace tissueform
