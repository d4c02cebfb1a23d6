// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <numbers>

#include <Eigen/Core>

#include "client/cli/predict/plan_fit_report.h"

namespace tissueform {

// What both forms of a report say in the same way.

inline constexpr double kDegreesPerRadian = 180 / std::numbers::pi;

// Degrees of a radian, or 1 of a length.
double UnitsOf(const FitUnknown& unknown);
// From LPS to the plan's axes.
Eigen::Vector3d InOwnAxes(const FitReport& report, const Eigen::Vector3d& lps);
bool IsReached(const FitReport& report, size_t target);
bool IsMoving(const FitReport& report, size_t handle);
// How the middle of a handle's vertices moves, in the plan's axes.
Eigen::Vector3d MiddleMoves(const FitReport& report, size_t handle);
const char* BoundName(ActiveBound bound);  // "none", "lower", "upper"

}  // namespace tissueform
