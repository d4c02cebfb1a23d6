// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/plan_fitting/handle_movement.h"

#include <Eigen/Eigenvalues>

namespace tissueform {

Eigen::Matrix<double, 6, 6> MovementRoot(const TetMesh& mesh, const std::vector<int32_t>& vertices,
                                         const Eigen::Vector3d& pivot_mm) {
  Eigen::Matrix<double, 6, 6> mean = Eigen::Matrix<double, 6, 6>::Zero();
  for (const int32_t v : vertices) {
    const Eigen::Vector3d arm = mesh.positions().row(v).transpose() - pivot_mm;
    Eigen::Matrix<double, 3, 6> moves;       // w x arm + t
    moves << 0, arm.z(), -arm.y(), 1, 0, 0,  //
        -arm.z(), 0, arm.x(), 0, 1, 0,       //
        arm.y(), -arm.x(), 0, 0, 0, 1;
    mean += moves.transpose() * moves / static_cast<double>(vertices.size());
  }
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>>(mean).operatorSqrt();
}

}  // namespace tissueform
