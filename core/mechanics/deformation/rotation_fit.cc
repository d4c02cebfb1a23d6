// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/rotation_fit.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include "core/base/parallel_for.h"
#include "core/mechanics/deformation/closest_rotation.h"

namespace tissueform {
namespace {

constexpr Eigen::Index kBatch = RotationBatch::kSize;

// F - I = sum over corners of (d_a - d_0) (grad phi_a)^T.
Eigen::Matrix3d DisplacementGradient(const PiecewiseLinearElements& elements,
                                     const Positions& displacements, Eigen::Index cell) {
  const int32_t* corners = elements.cells.data() + 4 * cell;
  Eigen::Matrix3d edges;
  for (int a = 1; a < 4; ++a) {
    edges.col(a - 1) = displacements.row(corners[a]) - displacements.row(corners[0]);
  }
  return edges * HatGradients<4>(elements, cell).transpose();
}

// Cells [begin, end), at most one batch; returns their energy.
double FitBatch(const PiecewiseLinearElements& elements, const Eigen::VectorXd& stiffness,
                const Positions& displacements, Eigen::Index begin, Eigen::Index end,
                CellTransforms* rotations) {
  RotationBatch batch;
  Eigen::Matrix3d gradients[kBatch];
  for (Eigen::Index lane = 0; lane < kBatch; ++lane) {
    gradients[lane].setZero();
    if (begin + lane < end) {
      gradients[lane] = DisplacementGradient(elements, displacements, begin + lane);
    }
    for (int e = 0; e < 9; ++e) {
      batch.matrix[e][lane] = gradients[lane](e / 3, e % 3) + (e % 4 == 0 ? 1.0 : 0.0);
    }
  }
  ClosestRotations(&batch);
  double energy = 0;
  for (Eigen::Index lane = 0; begin + lane < end; ++lane) {
    const Eigen::Index cell = begin + lane;
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> rotation(rotations->row(cell).data());
    for (int e = 0; e < 9; ++e) {
      rotation(e / 3, e % 3) = batch.matrix[e][lane];
    }
    if (batch.reliable[lane] == 0.0) {
      rotation = ClosestRotation(gradients[lane] + Eigen::Matrix3d::Identity());
    }
    const Eigen::Matrix3d turn = rotation - Eigen::Matrix3d::Identity();
    energy += stiffness[cell] * elements.measures[cell] * (gradients[lane] - turn).squaredNorm();
  }
  return energy;
}

}  // namespace

double FitRotations(const PiecewiseLinearElements& elements, const Eigen::VectorXd& stiffness,
                    const Positions& displacements, int threads, CellTransforms* rotations) {
  rotations->resize(elements.num_cells(), 9);
  // Added up in the order of the batches afterwards: an energy that depended on the threads would
  // let them decide whether a step is accepted.
  std::vector<double> energies((elements.num_cells() + kBatch - 1) / kBatch);
  ParallelFor(threads, elements.num_cells(), kBatch, [&](Eigen::Index begin, Eigen::Index end) {
    for (Eigen::Index first = begin; first < end; first += kBatch) {
      energies[first / kBatch] = FitBatch(elements, stiffness, displacements, first,
                                          std::min(first + kBatch, end), rotations);
    }
  });
  return std::accumulate(energies.begin(), energies.end(), 0.0);
}

}  // namespace tissueform
