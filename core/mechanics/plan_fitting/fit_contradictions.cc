// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/plan_fitting/fit_contradictions.h"

#include <algorithm>
#include <cmath>

namespace tissueform {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Cosine of rows that are called parallel: targets a few mm apart on one lip are, the two ends of a
// chin are not.
constexpr double kParallel = 0.97;

}  // namespace

std::vector<std::pair<size_t, size_t>> FindContradictions(const FitProblem& problem,
                                                          const MatrixXd& jacobian,
                                                          const VectorXd& misses_mm) {
  struct Row {
    size_t target;
    Index row;
  };
  std::vector<Row> missed;
  Index row = 0;
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    const Index rows = problem.targets[t].along.rows();
    const double miss = misses_mm.segment(row, rows).norm();
    for (Index k = 0; k < rows; ++k, ++row) {
      // Those of its three that it is missed by, not the ones that are met beside them.
      if (miss > problem.tolerance_mm && std::abs(misses_mm[row]) > miss / 2) {
        missed.push_back({t, row});
      }
    }
  }
  std::vector<std::pair<size_t, size_t>> pairs;
  for (size_t i = 0; i < missed.size(); ++i) {
    for (size_t j = i + 1; j < missed.size(); ++j) {
      if (missed[i].target == missed[j].target) continue;
      const VectorXd a = jacobian.row(missed[i].row);
      const VectorXd b = jacobian.row(missed[j].row);
      const double product = a.dot(b);
      const bool is_parallel = std::abs(product) > kParallel * a.norm() * b.norm();
      const bool pulls_apart = product * misses_mm[missed[i].row] * misses_mm[missed[j].row] < 0;
      const std::pair pair(missed[i].target, missed[j].target);
      if (is_parallel && pulls_apart &&
          std::find(pairs.begin(), pairs.end(), pair) == pairs.end()) {
        pairs.push_back(pair);
      }
    }
  }
  return pairs;
}

}  // namespace tissueform
