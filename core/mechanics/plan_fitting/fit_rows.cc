// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/plan_fitting/fit_rows.h"

#include <algorithm>
#include <cmath>

namespace tissueform {

using Eigen::Index;

FitRows::FitRows(const FitProblem& problem)
    : problem_(problem),
      wanted_mm_(problem.num_equations()),
      root_weights_(problem.num_equations()) {
  Index row = 0;
  for (const FitTarget& target : problem.targets) {
    const std::vector<int32_t>& of_target = target.point.vertices;
    vertices_.insert(vertices_.end(), of_target.begin(), of_target.end());
    const Index count = target.along.rows();
    wanted_mm_.segment(row, count) = target.wanted_mm;
    root_weights_.segment(row, count).setConstant(std::sqrt(target.weight));
    row += count;
  }
  std::sort(vertices_.begin(), vertices_.end());
  vertices_.erase(std::unique(vertices_.begin(), vertices_.end()), vertices_.end());
  for (const FitTarget& target : problem.targets) {
    MeshPoint& point = points_.emplace_back(target.point);
    for (int32_t& v : point.vertices) {
      v = static_cast<int32_t>(std::lower_bound(vertices_.begin(), vertices_.end(), v) -
                               vertices_.begin());
    }
  }
}

Eigen::VectorXd FitRows::At(const Positions& chosen) const {
  Eigen::VectorXd rows(wanted_mm_.size());
  Index row = 0;
  for (size_t t = 0; t < points_.size(); ++t) {
    const FitTarget& target = problem_.targets[t];
    const Index count = target.along.rows();
    rows.segment(row, count) = target.along * (PointAt(t, chosen) - target.rest_mm);
    row += count;
  }
  return rows;
}

}  // namespace tissueform
