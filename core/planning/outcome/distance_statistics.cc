// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/outcome/distance_statistics.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace tissueform {
namespace {

// (distance, area), rising.
using Rising = std::vector<std::pair<double, double>>;

double PercentileOf(const Rising& rising, double area_mm2, double percent) {
  double sum = 0;
  for (const auto& [mm, area] : rising) {
    sum += area;
    // Rounding of the sum must not ask for more than there is.
    if (sum >= percent / 100 * area_mm2 * (1 - 1e-12)) return mm;
  }
  return rising.back().first;
}

}  // namespace

DistanceStatistics Summarize(const AreaDistances& distances) {
  DistanceStatistics result;
  Rising rising;
  rising.reserve(distances.mm.size());
  double area_mm2 = 0;
  for (size_t i = 0; i < distances.mm.size(); ++i) {
    const double mm = distances.mm[i];
    const double area = distances.area_mm2[i];
    if (area <= 0) continue;
    rising.emplace_back(std::abs(mm), area);
    area_mm2 += area;
    result.mean_mm += area * mm;
    result.mean_absolute_mm += area * std::abs(mm);
    if (std::abs(mm) > 1) result.share_over_1mm += area;
    if (std::abs(mm) > 2) result.share_over_2mm += area;
  }
  if (rising.empty()) return {};
  std::ranges::sort(rising);
  result.area_cm2 = area_mm2 / 100;
  result.mean_mm /= area_mm2;
  result.mean_absolute_mm /= area_mm2;
  result.share_over_1mm /= area_mm2;
  result.share_over_2mm /= area_mm2;
  result.p50_mm = PercentileOf(rising, area_mm2, 50);
  result.p90_mm = PercentileOf(rising, area_mm2, 90);
  result.p95_mm = PercentileOf(rising, area_mm2, 95);
  result.max_mm = rising.back().first;
  return result;
}

}  // namespace tissueform
