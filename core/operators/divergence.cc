// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/operators/divergence.h"

#include "core/operators/gradient.h"
#include "core/operators/mass_matrix.h"

namespace tissueform {

SparseMatrix Divergence(const TetMesh& mesh, const Eigen::VectorXd& stiffness) {
  return Gradient(mesh).transpose() * MassMatrix(mesh, stiffness);
}

}  // namespace tissueform
