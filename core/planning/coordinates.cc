// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/coordinates.h"

namespace tissueform {
namespace {

Eigen::Vector3d Signs(CoordinateSystem system) {
  return system == CoordinateSystem::kRas ? Eigen::Vector3d(-1, -1, 1) : Eigen::Vector3d::Ones();
}

}  // namespace

void SwapToOrFromLps(CoordinateSystem system, Positions* positions) {
  if (system == CoordinateSystem::kLps) return;
  positions->leftCols<2>() *= -1;
}

HandlePose SwapToOrFromLps(CoordinateSystem system, const HandlePose& pose) {
  const Eigen::Vector3d signs = Signs(system);
  return {.rotation_vector = signs.cwiseProduct(pose.rotation_vector),
          .pivot_mm = signs.cwiseProduct(pose.pivot_mm),
          .translation_mm = signs.cwiseProduct(pose.translation_mm),
          .scale = pose.scale};
}

SelectBox SwapToOrFromLps(CoordinateSystem system, const SelectBox& box) {
  const Eigen::Vector3d a = Signs(system).cwiseProduct(box.min_mm);
  const Eigen::Vector3d b = Signs(system).cwiseProduct(box.max_mm);
  return {a.cwiseMin(b), a.cwiseMax(b)};
}

}  // namespace tissueform
