// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "absl/types/span.h"

namespace tissueform {

// The one definition of a percentile in every report: nearest rank. The smallest of the values that
// at least `percent` % of them do not exceed, so it is always one of the values and p100 is the
// largest; what numpy calls method="inverted_cdf". Values at ranks between are not interpolated: a
// p99 of few values is their largest.
//
// REQUIRES: at least one value, none of them NaN; 0 <= percent <= 100.
double Percentile(std::vector<double> values, double percent);
// The same for values that rise.
double PercentileOfRising(absl::Span<const double> rising, double percent);

// The middle of the values, or the mean of the two in the middle: of repeated measurements. Where
// their number is odd it is the 50th percentile. REQUIRES: as above.
double Median(std::vector<double> values);

}  // namespace tissueform
