// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "core/mechanics/deformation/mesh_preparation.h"
#include "tests/testing/meshes.h"

namespace tissueform::testing {

// A bar of uneven stiffness on its lower end, one handle or two side by side at its upper end.
inline absl::StatusOr<std::shared_ptr<MeshPreparation>> PrepareBar(PreparationOptions options = {},
                                                                   int handles = 1) {
  const TetMesh mesh = Bar({4, 3, 8}, 1.0, 0.15);
  const auto at_top = [&](double from, double to) {
    return SelectVertices(mesh, [from, to](const Eigen::Vector3d& v) {
      return v.z() > 7.5 && v.x() > from && v.x() < to;
    });
  };
  std::vector<HandleRegion> regions;
  if (handles == 1) {
    regions = {{"top", at_top(-1, 9)}};
  } else {
    regions = {{"left", at_top(-1, 1.5)}, {"right", at_top(2.5, 9)}};
  }
  const auto fixed = SelectVertices(mesh, [](const Eigen::Vector3d& v) { return v.z() < 0.5; });
  const auto constraints = ConstraintSet::Create(mesh, fixed, regions);
  Eigen::VectorXd stiffness(mesh.num_tets());
  for (Eigen::Index t = 0; t < stiffness.size(); ++t) {
    stiffness[t] = t % 3 == 0 ? 15000.0 : 3000.0;
  }
  return MeshPreparation::Create(mesh, stiffness, constraints.value(), std::move(options));
}

// A block whose whole boundary is the handle: an affine motion of it is the answer everywhere.
inline absl::StatusOr<std::shared_ptr<MeshPreparation>> PrepareWrappedBlock() {
  const TetMesh mesh = Bar({4, 4, 4}, 1.0, 0.15);
  auto boundary = SelectVertices(
      mesh, [](const Eigen::Vector3d& v) { return v.minCoeff() < 0.5 || v.maxCoeff() > 3.5; });
  const auto constraints = ConstraintSet::Create(mesh, {}, {{"hull", std::move(boundary)}});
  const Eigen::VectorXd stiffness = Eigen::VectorXd::Constant(mesh.num_tets(), 3000.0);
  return MeshPreparation::Create(mesh, stiffness, constraints.value(), {});
}

inline HandlePose Pose(const Eigen::Vector3d& rotation_vector,
                       const Eigen::Vector3d& translation_mm, double scale = 1.0) {
  HandlePose pose;
  pose.rotation_vector = rotation_vector;
  pose.pivot_mm = {2.0, 1.5, 8.0};
  pose.translation_mm = translation_mm;
  pose.scale = scale;
  return pose;
}

// Largest distance of the constrained vertices of handle `handle` from where the pose puts them.
inline double BoundaryError(const MeshPreparation& preparation, const HandlePose& pose,
                            size_t handle, const Positions& positions) {
  double largest = 0;
  for (const int32_t v : preparation.constraints().handles()[handle].vertices) {
    const Eigen::Vector3d rest = preparation.mesh().positions().row(v);
    const Eigen::Vector3d moved = positions.row(v);
    largest = std::max(largest, (moved - ApplyPose(pose, rest)).norm());
  }
  return largest;
}

}  // namespace tissueform::testing
