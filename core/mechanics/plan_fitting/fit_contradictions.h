// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "core/mechanics/plan_fitting/fit_problem.h"

namespace tissueform {

// Pairs of targets that ask the same of the bone and want different things: rows that are nearly
// parallel, missed to opposite sides, both by more than the tolerance.
std::vector<std::pair<size_t, size_t>> FindContradictions(const FitProblem& problem,
                                                          const Eigen::MatrixXd& jacobian,
                                                          const Eigen::VectorXd& misses_mm);

}  // namespace tissueform
