// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "absl/status/statusor.h"

#include "core/base/types.h"

namespace tissueform {

// Distances between corresponding vertices of two results, in mm. Percentiles are nearest-rank.
struct DistanceSummary {
  Eigen::Index count = 0;
  double mean_mm = 0;
  double p50_mm = 0;
  double p90_mm = 0;
  double p95_mm = 0;
  double max_mm = 0;
};

// Distance of every vertex, #V. Errors: InvalidArgument when the vertex counts differ.
absl::StatusOr<Eigen::VectorXd> VertexDistances(const Positions& a, const Positions& b);

// REQUIRES: at least one distance.
DistanceSummary SummarizeDistances(std::vector<double> distances_mm);

// One summary for each value of `regions` (#V labels), in rising order of the label.
std::map<int64_t, DistanceSummary> SummarizeDistancesByRegion(const Eigen::VectorXd& distances_mm,
                                                              const std::vector<int64_t>& regions);

}  // namespace tissueform
