// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/status.h"

#include "client/lab/experiments/experiment.h"

namespace tissueform {

// Beside the names of cases, the study of volumetric locking.
inline constexpr char kLockingCase[] = "locking";

// All models against CalculiX on a bar, the layered block and the bundled plans, at two or four
// Poisson's ratios, and volumetric locking: docs/accuracy.md. Needs the program ccx; minutes.
//
// Writes accuracy.csv (distances), accuracy_movements.csv (of the face's foremost points),
// accuracy_summary.md, accuracy_CASE.png, accuracy_nu.png and accuracy_locking.csv and .png.
absl::Status RunAccuracyExperiment(const ExperimentOptions& options);

}  // namespace tissueform
