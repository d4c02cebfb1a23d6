// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/status.h"

#include "client/lab/experiments/experiment.h"

namespace tissueform {

// Contact as lips and cheeks have it against CalculiX: two blocks and a turning plate with
// CalculiX's own contact of surfaces, and a bundled head with the same rows. Writes lips.csv and
// prints it. Needs ccx.
absl::Status RunLipsExperiment(const ExperimentOptions& options);

}  // namespace tissueform
