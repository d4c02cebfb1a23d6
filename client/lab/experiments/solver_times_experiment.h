// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <cstdint>

#include "absl/status/statusor.h"
#include <Eigen/Core>

#include "client/lab/experiments/experiment.h"

namespace tissueform {

// What Table 1 says of one mesh, in seconds; medians of several runs.
struct SolverTimes {
  Eigen::Index vertices = 0;
  Eigen::Index tets = 0;
  double analyse = 0;         // ordering and shape of the factor, once for a mesh and its regions
  double factorise = 0;       // its numbers
  double three_solves = 0;    // back-substitution of x, y and z in one pass
  Eigen::Index unknowns = 0;  // free vertices
  int64_t factor_bytes = 0;   // of one factorisation
  int num_factorizations = 0;
  int num_solves = 0;  // each for x, y and z
};

// A bar of cubes with both ends constrained. REQUIRES: repetitions >= 1.
absl::StatusOr<SolverTimes> TimeBar(const std::array<int, 3>& cells, int repetitions, int threads);

// Table 1: the five bars, beside the source's times. Writes table1.csv and table1.md.
absl::Status RunSolverTimesExperiment(const ExperimentOptions& options);

}  // namespace tissueform
