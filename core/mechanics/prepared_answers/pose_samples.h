// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/deformation/mesh_preparation.h"

namespace tissueform {

// Poses of all handles that a drag may come by.
struct PoseRange {
  double rotation_rad = 0;
  double scale_change = 0;  // |s - 1|
  double translation_mm = 0;
  double pivot_offset_mm = 0;  // from the middle of the handle
};

// So many of them, each a pose for every handle, the same ones at every call: directions and sizes
// at random, every other one at the edge of the range with all that it has. `centroids`: of the
// handles.
std::vector<std::vector<HandlePose>> SamplePoses(const std::vector<Eigen::Vector3d>& centroids,
                                                 const PoseRange& range, int count);

// The middle of every handle's vertices at rest.
std::vector<Eigen::Vector3d> HandleCentroids(const MeshPreparation& preparation);

}  // namespace tissueform
