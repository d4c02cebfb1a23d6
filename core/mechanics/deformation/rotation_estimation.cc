// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/rotation_estimation.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "core/base/parallel_for.h"
#include "core/mechanics/deformation/closest_rotation.h"

namespace tissueform {
namespace {

using RowMajor3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
constexpr Eigen::Index kBatch = RotationBatch::kSize;

double MapToWeight(double u, BlendMap map) {
  switch (map) {
    case BlendMap::kCosine:
      // Clamped: with obtuse tets harmonic values may leave [0, 1] (negative weights), and a
      // power outside would turn the wrong way or too far.
      return std::clamp(std::cos(std::numbers::pi * (u - 0.5)), 0.0, 1.0);
    case BlendMap::kLinear:
      return std::clamp(2.0 * (1.0 - u), 0.0, 1.0);
    case BlendMap::kUnblended:
      break;
  }
  return 1.0;
}

// F = sum over corners of x_a (grad phi_a)^T, here with x_a - x_0, so that corner 0 plays no part.
// The number of corners is known to the compiler: this is the hot loop.
template <int kCorners>
Eigen::Matrix3d GradientOverCorners(const PiecewiseLinearElements& elements,
                                    const Positions& positions, Eigen::Index cell) {
  const int32_t* corners = elements.cells.data() + kCorners * cell;
  const auto x = [&positions, corners](int corner) {
    return Eigen::Map<const Eigen::Vector3d>(positions.data() + 3 * Eigen::Index{corners[corner]});
  };
  Eigen::Matrix<double, 3, kCorners - 1> edges;
  for (int a = 1; a < kCorners; ++a) {
    edges.col(a - 1) = x(a) - x(0);
  }
  return edges * HatGradients<kCorners>(elements, cell).transpose();
}

// Of a triangle, completed by deformed normal times rest normal.
Eigen::Matrix3d DeformationGradient(const PiecewiseLinearElements& elements,
                                    const Positions& positions, Eigen::Index cell) {
  if (elements.corners() == 4) {
    return GradientOverCorners<4>(elements, positions, cell);
  }
  const Eigen::Vector3d origin = positions.row(elements.cells(cell, 0));
  const Eigen::Vector3d a = positions.row(elements.cells(cell, 1)).transpose() - origin;
  const Eigen::Vector3d b = positions.row(elements.cells(cell, 2)).transpose() - origin;
  return GradientOverCorners<3>(elements, positions, cell) +
         a.cross(b).normalized() * elements.normals.row(cell);
}

// Scale and rotation of a propagated transform.
struct ScaledRotation {
  double scale = 1;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
};

ScaledRotation Split(const CellTransforms& propagated, Eigen::Index cell) {
  ScaledRotation split;
  if (propagated.rows() > 0) {
    const Eigen::Map<const RowMajor3d> P(propagated.row(cell).data());
    split.scale = P.row(0).norm();
    split.rotation = P / split.scale;
  }
  return split;
}

void Store(const Eigen::Matrix3d& matrix, Eigen::Index lane, RotationBatch* batch) {
  for (int e = 0; e < 9; ++e) {
    batch->matrix[e][lane] = matrix(e / 3, e % 3);
  }
}

Eigen::Matrix3d Load(const RotationBatch& batch, Eigen::Index lane) {
  Eigen::Matrix3d matrix;
  for (int e = 0; e < 9; ++e) {
    matrix(e / 3, e % 3) = batch.matrix[e][lane];
  }
  return matrix;
}

// Cells [begin, end), at most one batch.
class BatchEstimator {
 public:
  BatchEstimator(const PiecewiseLinearElements& elements, const Positions& positions,
                 const Eigen::VectorXd& weights, const CellTransforms& propagated)
      : elements_(elements), positions_(positions), weights_(weights), propagated_(propagated) {}

  void Estimate(Eigen::Index begin, Eigen::Index end, CellTransforms* transforms) {
    for (Eigen::Index lane = 0; lane < kBatch; ++lane) {
      const bool used = begin + lane < end;
      Store(used ? DeformationGradient(elements_, positions_, begin + lane)
                 : Eigen::Matrix3d::Identity(),
            lane, &batch_);
      exponents_[lane] = used ? weights_[begin + lane] : 0.0;
    }
    ClosestRotations(&batch_);
    // One by one by the slower function: few tets of a usable answer are inverted or turned half
    // round, so the batch stays the price.
    RepairUnreliable([](const Eigen::Matrix3d& F, double) { return ClosestRotation(F); });
    if (propagated_.rows() > 0) {
      for (Eigen::Index lane = 0; begin + lane < end; ++lane) {
        Store(Split(propagated_, begin + lane).rotation.transpose() * Load(batch_, lane), lane,
              &batch_);
      }
    }
    RotationPowers(exponents_, &batch_);
    RepairUnreliable(RotationPower);
    for (Eigen::Index lane = 0; begin + lane < end; ++lane) {
      WriteResult(begin + lane, lane, transforms);
    }
  }

 private:
  template <typename ScalarFunction>
  void RepairUnreliable(const ScalarFunction& function) {
    for (Eigen::Index lane = 0; lane < kBatch; ++lane) {
      if (batch_.reliable[lane] == 0.0) {
        Store(function(Load(batch_, lane), exponents_[lane]), lane, &batch_);
        batch_.reliable[lane] = 1.0;
      }
    }
  }

  void WriteResult(Eigen::Index cell, Eigen::Index lane, CellTransforms* transforms) const {
    if (propagated_.rows() == 0) {
      for (int e = 0; e < 9; ++e) {
        (*transforms)(cell, e) = batch_.matrix[e][lane];
      }
      return;
    }
    const ScaledRotation split = Split(propagated_, cell);
    Eigen::Map<RowMajor3d>(transforms->row(cell).data()) =
        std::pow(split.scale, 1.0 - exponents_[lane]) * split.rotation * Load(batch_, lane);
  }

  const PiecewiseLinearElements& elements_;
  const Positions& positions_;
  const Eigen::VectorXd& weights_;
  const CellTransforms& propagated_;
  RotationBatch batch_;
  alignas(64) double exponents_[kBatch];
};

}  // namespace

Eigen::VectorXd BlendWeights(const CellField& harmonic, BlendMap map) {
  Eigen::VectorXd weights(harmonic.rows());
  for (Eigen::Index c = 0; c < harmonic.rows(); ++c) {
    const double fixed = 1.0 - harmonic.row(c).sum();
    weights[c] = MapToWeight(std::max(fixed, harmonic.row(c).maxCoeff()), map);
  }
  return weights;
}

void EstimateRotations(const PiecewiseLinearElements& elements, const Positions& positions,
                       const Eigen::VectorXd& weights, const CellTransforms& propagated,
                       int threads, CellTransforms* transforms) {
  transforms->resize(elements.num_cells(), 9);
  ParallelFor(threads, elements.num_cells(), kBatch, [&](Eigen::Index begin, Eigen::Index end) {
    BatchEstimator estimator(elements, positions, weights, propagated);
    for (Eigen::Index first = begin; first < end; first += kBatch) {
      estimator.Estimate(first, std::min(first + kBatch, end), transforms);
    }
  });
}

}  // namespace tissueform
