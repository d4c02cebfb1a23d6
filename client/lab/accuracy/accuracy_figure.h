// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"

#include "client/lab/accuracy/accuracy_run.h"

namespace tissueform {

// The models' answers side by side, coloured by their distance to CalculiX's neo-Hookean answer on
// the skin, with one colour bar for all panels.
//
// REQUIRES: the result has that reference.
absl::Status DrawAccuracyCase(const AccuracyCase& problem, const AccuracyResult& result,
                              const std::string& path);

// One case at all its Poisson's ratios.
struct AccuracySweep {
  std::string name;
  double largest_displacement_mm = 0;
  std::vector<AccuracyResult> results;
};

// Mean distance to CalculiX's neo-Hookean answer over Poisson's ratio, as a part of the largest
// displacement, a curve for each case: of the gradient field by both modes and of ARAP.
absl::Status DrawPoissonRatios(const std::vector<AccuracySweep>& sweeps, const std::string& path);

}  // namespace tissueform
