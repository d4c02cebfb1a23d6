// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/comparison.h"

#include <algorithm>
#include <numeric>

#include "absl/strings/str_cat.h"

#include "core/base/percentiles.h"

namespace tissueform {

absl::StatusOr<Eigen::VectorXd> VertexDistances(const Positions& a, const Positions& b) {
  if (a.rows() != b.rows()) {
    return absl::InvalidArgumentError(absl::StrCat("the first result has ", a.rows(),
                                                   " vertices, the second ", b.rows(),
                                                   "; compare results of the same mesh"));
  }
  return Eigen::VectorXd((a - b).rowwise().norm());
}

DistanceSummary SummarizeDistances(std::vector<double> distances_mm) {
  std::sort(distances_mm.begin(), distances_mm.end());
  DistanceSummary summary;
  summary.count = static_cast<Eigen::Index>(distances_mm.size());
  summary.mean_mm = std::accumulate(distances_mm.begin(), distances_mm.end(), 0.0) /
                    static_cast<double>(distances_mm.size());
  summary.p50_mm = PercentileOfRising(distances_mm, 50);
  summary.p90_mm = PercentileOfRising(distances_mm, 90);
  summary.p95_mm = PercentileOfRising(distances_mm, 95);
  summary.max_mm = distances_mm.back();
  return summary;
}

std::map<int64_t, DistanceSummary> SummarizeDistancesByRegion(const Eigen::VectorXd& distances_mm,
                                                              const std::vector<int64_t>& regions) {
  std::map<int64_t, std::vector<double>> grouped;
  for (size_t v = 0; v < regions.size(); ++v) {
    grouped[regions[v]].push_back(distances_mm[static_cast<Eigen::Index>(v)]);
  }
  std::map<int64_t, DistanceSummary> summaries;
  for (auto& [region, distances] : grouped) {
    summaries[region] = SummarizeDistances(std::move(distances));
  }
  return summaries;
}

}  // namespace tissueform
