// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/statusor.h"

#include "client/lab/experiments/bar_translation.h"
#include "client/lab/experiments/experiment.h"

namespace tissueform {

// Fig. 4: a bar with translational constraints after 1, 6, 10 and 20 updates of the linear and of
// the cosine blend; how fast they converge, plainly and with Anderson acceleration.
absl::Status RunBlendExperiment(const ExperimentOptions& options);

}  // namespace tissueform
