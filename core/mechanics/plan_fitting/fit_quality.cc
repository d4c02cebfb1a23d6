// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/plan_fitting/fit_quality.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <Eigen/Cholesky>
#include <Eigen/SVD>

namespace tissueform {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// An unknown that moves more than a third of what the strongest one does belongs to a direction's
// name.
constexpr double kMainShare = 1.0 / 3;

std::vector<size_t> MainUnknowns(const VectorXd& movement_of_unknowns) {
  std::vector<size_t> order(static_cast<size_t>(movement_of_unknowns.size()));
  std::iota(order.begin(), order.end(), size_t{0});
  const auto size = [&](size_t i) { return std::abs(movement_of_unknowns[static_cast<Index>(i)]); };
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return size(a) > size(b); });
  const double least = kMainShare * size(order.front());
  std::erase_if(order, [&](size_t i) { return size(i) <= least; });
  return order;
}

}  // namespace

// In the coordinates z = C' x, C C' = M the movement of the free unknowns, 1 is 1 mm of bone in
// any direction. There J = U S V', the regularised answer is V diag(s / (s^2 + l^2)) U' of the
// targets, and diag(s^2 / (s^2 + l^2)) is the part of it that the targets decide.
FitQuality MeasureFitQuality(const MatrixXd& jacobian, const MatrixXd& movement,
                             const std::vector<ActiveBound>& bounds, double less_movement) {
  FitQuality quality;
  quality.unknowns.resize(bounds.size());
  std::vector<Index> free;
  for (size_t i = 0; i < bounds.size(); ++i) {
    if (bounds[i] == ActiveBound::kNone) free.push_back(static_cast<Index>(i));
  }
  if (free.empty()) return quality;
  MatrixXd M = (movement.transpose() * movement)(free, free);
  // A turn about the only vertex of a handle moves nothing.
  M.diagonal().array() += 1e-12 * std::max(M.diagonal().maxCoeff(), 1e-12);
  const MatrixXd C = M.llt().matrixL();
  const auto upper = C.transpose().triangularView<Eigen::Upper>();
  const MatrixXd J = jacobian(Eigen::all, free);
  const MatrixXd J_moves = C.triangularView<Eigen::Lower>().solve(J.transpose()).transpose();
  const Eigen::JacobiSVD<MatrixXd> svd(J_moves, Eigen::ComputeThinU | Eigen::ComputeFullV);
  const Index n = static_cast<Index>(free.size());
  VectorXd s = VectorXd::Zero(n);
  s.head(svd.singularValues().size()) = svd.singularValues();
  // Below it a singular value is rounding, which without regularisation would be divided by.
  const double l = std::max(less_movement, 1e-6 * std::max(s[0], 1e-9));
  const VectorXd decided = s.array().square() / (s.array().square() + l * l);
  const VectorXd gains = s.array() / (s.array().square() + l * l);
  const MatrixXd& V = svd.matrixV();
  const MatrixXd X = upper.solve(V);  // unknowns of the directions
  // Variances of the unknowns, times l^2, before and after the targets are known.
  const VectorXd before = X.rowwise().squaredNorm();
  const VectorXd left = (1 - decided.array()).matrix();
  const VectorXd after = X.cwiseAbs2() * left;
  for (Index k = 0; k < n; ++k) {
    Determination& of = quality.unknowns[static_cast<size_t>(free[static_cast<size_t>(k)])];
    of.by_targets = std::clamp(1 - after[k] / before[k], 0.0, 1.0);
    of.error_per_mm = (X.row(k).transpose().array() * gains.array()).matrix().norm();
  }
  const double root_rows = std::sqrt(static_cast<double>(std::max<Index>(1, jacobian.rows())));
  for (Index d = 0; d < n; ++d) {
    FitDirection& direction = quality.directions.emplace_back();
    direction.singular_value = s[d] / root_rows;
    direction.by_targets = decided[d];
    direction.shares = VectorXd::Zero(jacobian.cols());
    direction.shares(free) = X.col(d);
    direction.main_unknowns =
        MainUnknowns(direction.shares.cwiseProduct(movement.colwise().norm().transpose()));
  }
  return quality;
}

}  // namespace tissueform
