// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/status.h"

#include "client/lab/experiments/experiment.h"

namespace tissueform {

// The band of uncertainty from stiffness (core/mechanics/uncertainty) on the bundled heads against
// sampling in full: every sample of a Latin hypercube solved with stiffnesses and a factor of its
// own. uncertainty.csv, and a picture a head and model of the band at factor 2.
absl::Status RunUncertaintyExperiment(const ExperimentOptions& options);

}  // namespace tissueform
