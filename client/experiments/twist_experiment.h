// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/experiments/experiment.h"

namespace tissueform {

// Fig. 1: a twist of 360 degrees of a bar of tets and of its boundary surface.
absl::Status RunTwistExperiment(const ExperimentOptions& options);

}  // namespace tissueform
