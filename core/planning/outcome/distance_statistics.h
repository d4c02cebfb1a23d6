// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

namespace tissueform {

// Signed distances with the area that each stands for, so that dense triangles do not count more.
struct AreaDistances {
  std::vector<double> mm;
  std::vector<double> area_mm2;  // as many, not negative
};

// Of signed distances. The percentiles, the largest and the shares are of their absolute values.
struct DistanceStatistics {
  double area_cm2 = 0;
  double mean_mm = 0;  // signed
  double mean_absolute_mm = 0;
  double p50_mm = 0;
  double p90_mm = 0;
  double p95_mm = 0;
  double max_mm = 0;
  double share_over_1mm = 0;  // of the area, in [0, 1]
  double share_over_2mm = 0;
};

// A percentile is the smallest distance that at least this share of the area does not exceed. All 0
// without area.
DistanceStatistics Summarize(const AreaDistances& distances);

}  // namespace tissueform
