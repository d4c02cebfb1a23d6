// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/operators/mass_matrix.h"

#include "core/mesh/tet_quality.h"

namespace tissueform {

SparseMatrix MassMatrix(const TetMesh& mesh, const Eigen::VectorXd& stiffness) {
  const Eigen::VectorXd weights = stiffness.cwiseProduct(TetVolumes(mesh.positions(), mesh.tets()));
  SparseMatrix M(3 * mesh.num_tets(), 3 * mesh.num_tets());
  M.reserve(Eigen::VectorXi::Ones(M.cols()));
  for (Eigen::Index row = 0; row < M.rows(); ++row) {
    M.insert(row, row) = weights[row / 3];
  }
  M.makeCompressed();
  return M;
}

}  // namespace tissueform
