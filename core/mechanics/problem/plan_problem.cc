// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/problem/plan_problem.h"

namespace tissueform {

Eigen::Vector3d SignsToLps(CoordinateSystem system) {
  return system == CoordinateSystem::kRas ? Eigen::Vector3d(-1, -1, 1) : Eigen::Vector3d::Ones();
}

void SwapToOrFromLps(CoordinateSystem system, Positions* positions) {
  if (system == CoordinateSystem::kLps) return;
  positions->leftCols<2>() *= -1;
}

HandlePose SwapToOrFromLps(CoordinateSystem system, const HandlePose& pose) {
  const Eigen::Vector3d signs = SignsToLps(system);
  return {.rotation_vector = signs.cwiseProduct(pose.rotation_vector),
          .pivot_mm = signs.cwiseProduct(pose.pivot_mm),
          .translation_mm = signs.cwiseProduct(pose.translation_mm),
          .scale = pose.scale};
}

}  // namespace tissueform
