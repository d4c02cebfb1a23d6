// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/mesh/tet_mesh.h"

namespace tissueform {

// How much bone moves, to first order: with q the six numbers of a handle's pose (rotation vector
// in rad, translation in mm), |S q|^2 is the mean of the squared displacements of its vertices.
Eigen::Matrix<double, 6, 6> MovementRoot(const TetMesh& mesh, const std::vector<int32_t>& vertices,
                                         const Eigen::Vector3d& pivot_mm);

}  // namespace tissueform
