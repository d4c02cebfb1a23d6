// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/plan_fitting/bounded_least_squares.h"

#include <algorithm>

#include "core/plan_fitting/box_program.h"

namespace tissueform {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kFirstDamping = 1e-6;
constexpr double kLeastDamping = 1e-12;
constexpr double kMostDamping = 1e12;

class Search {
 public:
  Search(const LeastSquaresProblem& problem, const VectorXd& start)
      : problem_(problem), prior_(problem.A.transpose() * problem.A) {
    at_.x = start.cwiseMax(problem.lower).cwiseMin(problem.upper);
    at_.residuals = problem.residuals(at_.x);
    value_ = Value(at_.x, at_.residuals);
  }

  LeastSquaresSolution Run() {
    TakeSlopes();
    while (!at_.converged && at_.iterations < problem_.max_iterations) {
      ++at_.iterations;
      if (StepDown()) {
        TakeSlopes();
      } else {
        // No step lowers the sum, not even a very short one: rounding is all that is left.
        at_.converged = true;
      }
    }
    FindActiveBounds();
    return at_;
  }

 private:
  double Value(const VectorXd& x, const VectorXd& residuals) const {
    return residuals.squaredNorm() + (problem_.A * x + problem_.c).squaredNorm();
  }

  void TakeSlopes() {
    const Index n = at_.x.size();
    at_.jacobian.resize(at_.residuals.size(), n);
    for (Index i = 0; i < n; ++i) {
      const double step = problem_.steps[i];
      VectorXd x = at_.x;
      x[i] = at_.x[i] + step;
      const VectorXd ahead = problem_.residuals(x);
      x[i] = at_.x[i] - step;
      at_.jacobian.col(i) = (ahead - problem_.residuals(x)) / (2 * step);
    }
    normal_ = at_.jacobian.transpose() * at_.jacobian + prior_;
    gradient_ = at_.jacobian.transpose() * at_.residuals +
                problem_.A.transpose() * (problem_.A * at_.x + problem_.c);
  }

  // Whether a step was made. Converged when it was a short one.
  bool StepDown() {
    const VectorXd lower = problem_.lower - at_.x;
    const VectorXd upper = problem_.upper - at_.x;
    for (; damping_ < kMostDamping; damping_ *= 10) {
      MatrixXd H = normal_;
      // The unknowns have one scale, so the plain form: Marquardt's would not hold those that
      // nothing depends on.
      H.diagonal().array() += damping_ * std::max(normal_.diagonal().maxCoeff(), 1e-12);
      const VectorXd step = SolveBoxProgram(H, gradient_, lower, upper);
      const bool is_short = step.cwiseAbs().maxCoeff() <= problem_.smallest_move;
      const VectorXd x = (at_.x + step).cwiseMax(problem_.lower).cwiseMin(problem_.upper);
      const VectorXd residuals = problem_.residuals(x);
      const double value = Value(x, residuals);
      if (value < value_) {
        at_.x = x;
        at_.residuals = residuals;
        value_ = value;
        damping_ = std::max(damping_ / 10, kLeastDamping);
        at_.converged = is_short;
        return true;
      }
      if (is_short) return false;
    }
    return false;
  }

  void FindActiveBounds() {
    at_.bounds.assign(static_cast<size_t>(at_.x.size()), ActiveBound::kNone);
    for (Index i = 0; i < at_.x.size(); ++i) {
      ActiveBound& bound = at_.bounds[static_cast<size_t>(i)];
      if (at_.x[i] <= problem_.lower[i] && gradient_[i] > 0) bound = ActiveBound::kLower;
      if (at_.x[i] >= problem_.upper[i] && gradient_[i] < 0) bound = ActiveBound::kUpper;
    }
  }

  const LeastSquaresProblem& problem_;
  const MatrixXd prior_;
  LeastSquaresSolution at_;
  double value_ = 0;
  MatrixXd normal_;
  VectorXd gradient_;  // half of the sum's
  double damping_ = kFirstDamping;
};

}  // namespace

LeastSquaresSolution SolveBoundedLeastSquares(const LeastSquaresProblem& problem,
                                              const VectorXd& start) {
  return Search(problem, start).Run();
}

}  // namespace tissueform
