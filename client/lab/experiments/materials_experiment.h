// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>

#include "absl/status/statusor.h"

#include "client/lab/experiments/bar_twist.h"
#include "client/lab/experiments/experiment.h"

namespace tissueform {

// Young's moduli of the two halves; the source gives no numbers.
inline constexpr double kSoftPa = 1000;
inline constexpr double kStiffPa = 3000;

// A bar of cubes of 1 mm whose lower half along z is soft and whose upper half is stiff.
absl::StatusOr<TwistProblem> TwoMaterialBar(const std::array<int, 3>& cells, int threads);

// Fig. 5: two materials under a twist of 360 degrees, volume and surface.
absl::Status RunMaterialsExperiment(const ExperimentOptions& options);

}  // namespace tissueform
