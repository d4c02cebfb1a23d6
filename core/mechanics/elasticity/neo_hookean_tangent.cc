// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/elasticity/neo_hookean_tangent.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>

#include "core/base/parallel_for.h"
#include "core/mechanics/elasticity/material.h"
#include "core/mechanics/elasticity/vertex_blocks.h"

namespace tissueform {
namespace {

constexpr Eigen::Index kTetGrain = 1024;

// The second derivatives of a tet's energy, in the frames U and V of its F = U diag(s) V^T: there
// the law couples an entry dF_ij only with dF_ji, and the three dF_ii with each other.
struct TetTangent {
  Eigen::Matrix3d U;
  Eigen::Matrix3d gradients;  // of the hat functions of corners 1 to 3, turned by V^T, times
                              // the root of |t| E
  Eigen::Matrix3d stretch;    // of dF_ii and dF_jj
  Eigen::Vector3d shear;      // of dF_ij with itself; entry k is of the pair without k
  Eigen::Vector3d swap;       // of dF_ij with dF_ji
};

Eigen::Matrix3d DeformationGradient(const PiecewiseLinearElements& elements,
                                    const Positions& displacements, Eigen::Index tet,
                                    const Eigen::Matrix3d& gradients) {
  const Eigen::Vector3d origin = displacements.row(elements.cells(tet, 0));
  Eigen::Matrix3d edges;
  for (int corner = 1; corner < 4; ++corner) {
    edges.col(corner - 1) = displacements.row(elements.cells(tet, corner)).transpose() - origin;
  }
  return Eigen::Matrix3d::Identity() + edges * gradients.transpose();
}

// Without its negative eigenvalues; untouched to the bit when all are positive or zero.
Eigen::Matrix3d WithoutNegative(const Eigen::Matrix3d& symmetric) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(symmetric);
  if (solver.eigenvalues()[0] >= 0) {
    return symmetric;
  }
  return solver.eigenvectors() * solver.eigenvalues().cwiseMax(0.0).asDiagonal() *
         solver.eigenvectors().transpose();
}

// Fills stretch, shear and swap from the principal stretches s. With c = cof F (c_i = J / s_i),
// a = mu J^(-2/3) and p = K (J - 1) - a I1 / (3 J) the principal stresses are W_i = a s_i + p c_i.
// Off the diagonal only dF and d(cof F) count: dP_ij = a dF_ij - p s_k dF_ji, with eigenvalues
// a - p s_k (dF symmetric) and a + p s_k (antisymmetric, zero at rest: turning is free).
void SetLaw(const ElasticModuli& unit, const Eigen::Vector3d& s, TangentForm form,
            TetTangent* tangent) {
  const double J = s.prod();
  const double norm2 = s.squaredNorm();  // the law's I1
  const double a = unit.shear / std::cbrt(J * J);
  const double p = unit.bulk * (J - 1) - a * norm2 / (3 * J);
  const Eigen::Vector3d c(s[1] * s[2], s[2] * s[0], s[0] * s[1]);
  tangent->stretch = (unit.bulk + 5.0 / 9.0 * a * norm2 / (J * J)) * c * c.transpose() -
                     2.0 / 3.0 * a / J * (s * c.transpose() + c * s.transpose());
  tangent->stretch.diagonal().array() += a;
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    tangent->stretch(i, j) += p * s[k];
    tangent->stretch(j, i) = tangent->stretch(i, j);
    tangent->shear[k] = a;
    tangent->swap[k] = -p * s[k];
  }
  if (form == TangentForm::kPositive) {
    tangent->stretch = WithoutNegative(tangent->stretch);
    for (int k = 0; k < 3; ++k) {
      const double symmetric = std::max(a - p * s[k], 0.0);
      const double antisymmetric = std::max(a + p * s[k], 0.0);
      tangent->shear[k] = 0.5 * (symmetric + antisymmetric);
      tangent->swap[k] = 0.5 * (symmetric - antisymmetric);
    }
  }
}

// U (sum_jl H_ij,kl g_j h_l)_ik U^T for the hat gradients g and h of two corners.
Eigen::Matrix3d BlockOf(const TetTangent& tangent, const Eigen::Vector3d& g,
                        const Eigen::Vector3d& h) {
  const Eigen::Vector3d products = g.cwiseProduct(h);
  Eigen::Matrix3d block;
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    block(i, j) = tangent.stretch(i, j) * g[i] * h[j] + tangent.swap[k] * g[j] * h[i];
    block(j, i) = tangent.stretch(j, i) * g[j] * h[i] + tangent.swap[k] * g[i] * h[j];
    block(k, k) = tangent.stretch(k, k) * products[k] + tangent.shear[i] * products[j] +
                  tangent.shear[j] * products[i];
  }
  return tangent.U * block * tangent.U.transpose();
}

}  // namespace

SparseMatrix NeoHookeanTangent(const PiecewiseLinearElements& elements,
                               const VertexCells& vertex_cells, const Eigen::VectorXd& stiffness,
                               double poisson_ratio, const Positions& displacements,
                               TangentForm form, int threads) {
  const ElasticModuli unit = ModuliOf(1.0, poisson_ratio);
  std::vector<TetTangent> tangents(static_cast<size_t>(elements.num_cells()));
  ParallelFor(threads, elements.num_cells(), kTetGrain, [&](Eigen::Index begin, Eigen::Index end) {
    for (Eigen::Index tet = begin; tet < end; ++tet) {
      const Eigen::Matrix3d gradients = HatGradients<4>(elements, tet);
      const Eigen::JacobiSVD<Eigen::Matrix3d> svd(
          DeformationGradient(elements, displacements, tet, gradients),
          Eigen::ComputeFullU | Eigen::ComputeFullV);
      TetTangent& tangent = tangents[static_cast<size_t>(tet)];
      tangent.U = svd.matrixU();
      tangent.gradients = std::sqrt(elements.measures[tet] * stiffness[tet]) *
                          (svd.matrixV().transpose() * gradients);
      SetLaw(unit, svd.singularValues(), form, &tangent);
    }
  });
  const auto blocks_of_tet = [&tangents](int32_t tet, int own, TetBlocks* blocks) {
    const TetTangent& tangent = tangents[static_cast<size_t>(tet)];
    Eigen::Matrix<double, 3, 4> g;
    g << -tangent.gradients.rowwise().sum(), tangent.gradients;
    for (int corner = 0; corner < 4; ++corner) {
      (*blocks)[static_cast<size_t>(corner)] = BlockOf(tangent, g.col(corner), g.col(own));
    }
  };
  return AssembleVertexBlocks(elements, vertex_cells, blocks_of_tet, threads);
}

int64_t NeoHookeanTangentWorkspaceBytes(Eigen::Index num_tets) {
  return num_tets * static_cast<int64_t>(sizeof(TetTangent));
}

}  // namespace tissueform
