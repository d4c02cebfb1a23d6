// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/operators/gradient.h"

#include <vector>

#include <Eigen/LU>

#include "core/mesh/tet_quality.h"

namespace tissueform {

HatGradientMatrix HatGradients(const TetMesh& mesh) {
  const Positions& v = mesh.positions();
  const TetIndices& tets = mesh.tets();
  HatGradientMatrix gradients(tets.rows(), 12);
  for (Eigen::Index t = 0; t < tets.rows(); ++t) {
    Eigen::Matrix3d edges;  // rows v_a - v_3
    for (int a = 0; a < 3; ++a) {
      edges.row(a) = v.row(tets(t, a)) - v.row(tets(t, 3));
    }
    const Eigen::Matrix3d inverse = edges.inverse();
    for (int a = 0; a < 3; ++a) {
      gradients.block<1, 3>(t, 3 * a) = inverse.col(a).transpose();
    }
    gradients.block<1, 3>(t, 9) = -inverse.rowwise().sum().transpose();
  }
  return gradients;
}

SparseMatrix Gradient(const TetMesh& mesh) {
  const HatGradientMatrix hat_gradients = HatGradients(mesh);
  std::vector<Eigen::Triplet<double, int32_t>> entries;
  entries.reserve(12 * mesh.num_tets());
  for (int32_t t = 0; t < mesh.num_tets(); ++t) {
    for (int corner = 0; corner < 4; ++corner) {
      for (int axis = 0; axis < 3; ++axis) {
        entries.emplace_back(3 * t + axis, mesh.tets()(t, corner),
                             hat_gradients(t, 3 * corner + axis));
      }
    }
  }
  SparseMatrix G(3 * mesh.num_tets(), mesh.num_vertices());
  G.setFromTriplets(entries.begin(), entries.end());
  return G;
}

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

SparseMatrix Divergence(const TetMesh& mesh, const Eigen::VectorXd& stiffness) {
  return Gradient(mesh).transpose() * MassMatrix(mesh, stiffness);
}

}  // namespace tissueform
