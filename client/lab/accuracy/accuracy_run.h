// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "client/lab/accuracy/accuracy_models.h"

namespace tissueform {

// All answers to one case at one Poisson's ratio.
struct AccuracyResult {
  double poisson_ratio = 0;
  std::vector<ModelAnswer> references;  // CalculiX, linear and neo-Hookean; those that it found
  std::vector<ModelAnswer> models;      // in the order of AllModelVariants

  // Null when no answer has that name.
  const ModelAnswer* Reference(const std::string& name) const;
  const ModelAnswer* Model(const std::string& name) const;
};

// Solves the case at every Poisson's ratio by every model and by CalculiX, in `folder`. A
// reference that CalculiX does not find is reported and left out; a missing program is an error.
// `on_step` gets a line for every step.
absl::StatusOr<std::vector<AccuracyResult>> RunAccuracyCase(
    const AccuracyCase& problem, const std::vector<double>& poisson_ratios,
    const std::string& folder, const std::function<void(const std::string&)>& on_step);

// The largest way of a vertex under a reference, mm: what distances are to be seen against.
double LargestDisplacement(const AccuracyCase& problem, const ModelAnswer& reference);

}  // namespace tissueform
