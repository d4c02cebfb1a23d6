// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/predict/fit_values.h"

#include <algorithm>

namespace tissueform {

using Eigen::Vector3d;

double UnitsOf(const FitUnknown& unknown) { return unknown.is_rotation ? kDegreesPerRadian : 1.0; }

Vector3d InOwnAxes(const FitReport& report, const Vector3d& lps) {
  return SignsToLps(report.problem->axes).cwiseProduct(lps);
}

bool IsReached(const FitReport& report, size_t target) {
  return report.fit->targets[target].missed_mm <= report.problem->tolerance_mm;
}

const char* BoundName(ActiveBound bound) {
  switch (bound) {
    case ActiveBound::kNone:
      break;
    case ActiveBound::kLower:
      return "lower";
    case ActiveBound::kUpper:
      return "upper";
  }
  return "none";
}

bool IsMoving(const FitReport& report, size_t handle) {
  const auto& unknowns = report.problem->unknowns;
  return std::any_of(unknowns.begin(), unknowns.end(),
                     [handle](const FitUnknown& unknown) { return unknown.handle == handle; });
}

Vector3d MiddleMoves(const FitReport& report, size_t handle) {
  const auto& vertices = report.plan->constraints.handles()[handle].vertices;
  const Vector3d middle =
      report.plan->mesh->positions()(vertices, Eigen::all).colwise().mean().transpose();
  return InOwnAxes(report, ApplyPose(report.fit->poses[handle], middle) - middle);
}

}  // namespace tissueform
