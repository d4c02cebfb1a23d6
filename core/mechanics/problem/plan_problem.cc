// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/problem/plan_problem.h"

#include <utility>

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

ConstraintSet StickingRegions(const PlanProblem& problem) {
  std::vector<int32_t> fixed = problem.constraints.fixed();
  std::vector<HandleRegion> handles = problem.constraints.handles();
  for (const FreedVertex& freed : problem.freed) {
    const bool of_fixed = freed.region == ConstraintSet::kFixed;
    (of_fixed ? fixed : handles[static_cast<size_t>(freed.region)].vertices)
        .push_back(freed.vertex);
  }
  // The vertices were free, each is in one region: nothing can be refused.
  return *ConstraintSet::Create(*problem.mesh, std::move(fixed), std::move(handles));
}

}  // namespace tissueform
