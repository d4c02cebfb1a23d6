// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/percentiles.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace tissueform {
namespace {

// Counted from 0. The product comes before the division: 7 / 100.0 * 100 is a little more than 7,
// and its ceiling a rank too high; 7.0 * 100 / 100 is 7.
size_t NearestRank(double percent, size_t count) {
  const double rank = std::ceil(percent * static_cast<double>(count) / 100);
  return static_cast<size_t>(std::max(rank, 1.0)) - 1;
}

}  // namespace

double Percentile(std::vector<double> values, double percent) {
  const auto nth =
      values.begin() + static_cast<std::ptrdiff_t>(NearestRank(percent, values.size()));
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

double PercentileOfRising(absl::Span<const double> rising, double percent) {
  return rising[NearestRank(percent, rising.size())];
}

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return (*middle + *std::max_element(values.begin(), middle)) / 2;
}

}  // namespace tissueform
