// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/accuracy/layered_block.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "client/lab/accuracy/boundary_surface.h"
#include "core/base/status_macros.h"
#include "core/mesh/bar_mesh.h"

namespace tissueform {
namespace {

constexpr double kLengthMm = 80;
constexpr double kWidthMm = 60;
constexpr double kHeightMm = 20;
constexpr double kMusclePa = 30000;
constexpr double kFatPa = 3000;
constexpr double kSkinPa = 100000;
constexpr double kMuscleTopMm = 10;
constexpr double kFatTopMm = 17.5;
constexpr double kRimMm = kLengthMm / 6;
constexpr double kMoveMm = 5;
constexpr int kTetsPerCell = 6;
// Of the borders of patch and rim, which lie on planes of the grid that are not exact numbers.
constexpr double kSlackMm = 1e-6;

double StiffnessAt(double height_mm) {
  if (height_mm < kMuscleTopMm) return kMusclePa;
  return height_mm < kFatTopMm ? kFatPa : kSkinPa;
}

// By cells and not by tets: a layer of cells is of one tissue.
Eigen::VectorXd LayerStiffness(const std::array<int, 3>& cells) {
  const Eigen::Index tets_per_layer = Eigen::Index{kTetsPerCell} * cells[0] * cells[1];
  Eigen::VectorXd stiffness(tets_per_layer * cells[2]);
  for (int layer = 0; layer < cells[2]; ++layer) {
    stiffness.segment(layer * tets_per_layer, tets_per_layer)
        .setConstant(StiffnessAt((layer + 0.5) * kHeightMm / cells[2]));
  }
  return stiffness;
}

bool IsInPatch(const Eigen::Vector3d& v) {
  return std::abs(v.x() - kLengthMm / 2) <= kLengthMm / 6 + kSlackMm &&
         std::abs(v.y() - kWidthMm / 2) <= kWidthMm / 6 + kSlackMm;
}

bool IsInRim(const Eigen::Vector3d& v) {
  return std::min(v.x(), kLengthMm - v.x()) <= kRimMm + kSlackMm ||
         std::min(v.y(), kWidthMm - v.y()) <= kRimMm + kSlackMm;
}

}  // namespace

absl::StatusOr<LayeredBlock> MakeLayeredBlock(const std::array<int, 3>& cells) {
  TF_ASSIGN_OR_RETURN(
      TetMesh mesh, BarMesh({EvenPlanes(0, kLengthMm, cells[0]), EvenPlanes(0, kWidthMm, cells[1]),
                             EvenPlanes(0, kHeightMm, cells[2])}));
  // The bottom is free between patch and rim. Were it fixed up to the patch, a patch that moves by
  // more than a cell along would pass through fixed vertices: tets invert under any material law.
  const auto is_bottom = [](const Eigen::Vector3d& v) { return v.z() == 0; };
  const std::vector<int32_t> fixed = VerticesWhere(
      mesh.positions(), [&](const Eigen::Vector3d& v) { return is_bottom(v) && IsInRim(v); });
  const std::vector<int32_t> patch = VerticesWhere(
      mesh.positions(), [&](const Eigen::Vector3d& v) { return is_bottom(v) && IsInPatch(v); });
  TF_ASSIGN_OR_RETURN(ConstraintSet constraints,
                      ConstraintSet::Create(mesh, fixed, {{"patch", patch}}));
  return LayeredBlock{std::move(mesh), LayerStiffness(cells), std::move(constraints)};
}

HandlePose MoveAlong() {
  HandlePose pose;
  pose.translation_mm.x() = kMoveMm;
  return pose;
}

HandlePose MoveUp() {
  HandlePose pose;
  pose.translation_mm.z() = kMoveMm;
  return pose;
}

}  // namespace tissueform
