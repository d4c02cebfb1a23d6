// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/plan_fitting/fit_quality.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/SVD>

namespace tissueform {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// An unknown that moves more than a third of what the strongest one does belongs to a direction's
// name.
constexpr double kMainShare = 1.0 / 3;
// Cosine of rows that are called parallel: targets a few mm apart on one lip are, the two ends of a
// chin are not.
constexpr double kParallel = 0.97;

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

// In the coordinates z = C' x, C C' = M the movement of the free unknowns, 1 is 1 mm of bone
// whatever moves. There J = U S V', the regularised answer is V diag(s / (s^2 + l^2)) U' of what is
// wanted, and diag(s^2 / (s^2 + l^2)) is the part of it that the targets decide.
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

std::vector<std::pair<size_t, size_t>> FindContradictions(const FitProblem& problem,
                                                          const MatrixXd& jacobian,
                                                          const VectorXd& misses_mm) {
  struct Row {
    size_t target;
    Index row;
  };
  std::vector<Row> missed;
  Index row = 0;
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    const Index rows = problem.targets[t].along.rows();
    const double miss = misses_mm.segment(row, rows).norm();
    for (Index k = 0; k < rows; ++k, ++row) {
      // Those of its three that it is missed by, not the ones that are met beside them.
      if (miss > problem.tolerance_mm && std::abs(misses_mm[row]) > miss / 2) {
        missed.push_back({t, row});
      }
    }
  }
  std::vector<std::pair<size_t, size_t>> pairs;
  for (size_t i = 0; i < missed.size(); ++i) {
    for (size_t j = i + 1; j < missed.size(); ++j) {
      if (missed[i].target == missed[j].target) continue;
      const VectorXd a = jacobian.row(missed[i].row);
      const VectorXd b = jacobian.row(missed[j].row);
      const double product = a.dot(b);
      const bool is_parallel = std::abs(product) > kParallel * a.norm() * b.norm();
      const bool pulls_apart = product * misses_mm[missed[i].row] * misses_mm[missed[j].row] < 0;
      const std::pair pair(missed[i].target, missed[j].target);
      if (is_parallel && pulls_apart &&
          std::find(pairs.begin(), pairs.end(), pair) == pairs.end()) {
        pairs.push_back(pair);
      }
    }
  }
  return pairs;
}

}  // namespace tissueform
