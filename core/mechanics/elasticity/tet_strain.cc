// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/elasticity/tet_strain.h"

#include <Eigen/Eigenvalues>

#include "core/base/parallel_for.h"

namespace tissueform {
namespace {

constexpr Eigen::Index kTetGrain = 4096;

}  // namespace

// sum over corners of d_a g_a^T with d = x - v: keeps the digits of small displacements.
Eigen::Matrix3d TetDisplacementGradient(const PiecewiseLinearElements& elements,
                                        const Positions& positions, Eigen::Index tet) {
  const auto displacement = [&](int corner) -> Eigen::Vector3d {
    const int32_t vertex = elements.cells(tet, corner);
    return positions.row(vertex) - elements.rest.row(vertex);
  };
  const Eigen::Vector3d origin = displacement(0);
  Eigen::Matrix3d edges;
  edges << displacement(1) - origin, displacement(2) - origin, displacement(3) - origin;
  return edges * HatGradients<4>(elements, tet).transpose();
}

Eigen::Matrix3d TetDeformationGradient(const PiecewiseLinearElements& elements,
                                       const Positions& positions, Eigen::Index tet) {
  return Eigen::Matrix3d::Identity() + TetDisplacementGradient(elements, positions, tet);
}

PrincipalValues PrincipalGreenStrains(const PiecewiseLinearElements& elements,
                                      const Positions& positions, int threads) {
  PrincipalValues strains(elements.num_cells(), 3);
  ParallelFor(threads, elements.num_cells(), kTetGrain, [&](Eigen::Index begin, Eigen::Index end) {
    for (Eigen::Index t = begin; t < end; ++t) {
      const Eigen::Matrix3d H = TetDisplacementGradient(elements, positions, t);
      // (F^T F - I) / 2 written with H = F - I: the ones do not cancel, so small strains keep their
      // digits.
      const Eigen::Matrix3d strain = 0.5 * (H + H.transpose() + H.transpose() * H);
      const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(strain, Eigen::EigenvaluesOnly);
      strains.row(t) = solver.eigenvalues().reverse();
    }
  });
  return strains;
}

}  // namespace tissueform
