// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/plan_fitting/bounded_least_squares.h"

#include <algorithm>

#include "core/mechanics/plan_fitting/box_program.h"
#include "core/mechanics/plan_fitting/residual_curvature.h"

namespace tissueform {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kFirstDamping = 1e-6;
constexpr double kLeastDamping = 1e-12;
constexpr double kMaxDamping = 1e12;

// Of the steps of differences: shorter ones drown in what residuals are rounded to.
constexpr double kEnoughForSlopes = 0.1;
constexpr double kEnoughForCurvature = 0.3;
// Of the sum: what it cannot resolve, because residuals are of single precision.
constexpr double kRounding = 1e-7;
// Of the sum that the slopes promise: when a step wins less, they are computed again.
constexpr double kLeastOfPromise = 0.5;
// In shortest steps.
constexpr double kSlopesHold = 100;

enum class Step { kNone, kShort, kGood, kPoor };  // kPoor: lower, but not as the slopes said

class Search {
 public:
  Search(const LeastSquaresProblem& problem, const VectorXd& start)
      : problem_(problem),
        prior_(problem.A.transpose() * problem.A),
        curvature_(problem.lower.size()) {
    at_.x = start.cwiseMax(problem.lower).cwiseMin(problem.upper);
    at_.residuals = problem.residuals(at_.x);
    value_ = Value(at_.x, at_.residuals);
  }

  LeastSquaresSolution Run() {
    TakeSlopes();
    while (!at_.converged && at_.iterations < problem_.max_iterations) {
      ++at_.iterations;
      const Step step = StepDown();
      if (step == Step::kGood) {
        LearnSlopes();
      } else if (step == Step::kPoor || !SlopesAreOfHere()) {
        TakeSlopes();
      } else {
        // No step lowers the sum, or a very short one only: rounding is all that is left.
        at_.converged = true;
        Linearise();
      }
    }
    FindActiveBounds();
    return at_;
  }

 private:
  double Value(const VectorXd& x, const VectorXd& residuals) const {
    return residuals.squaredNorm() + (problem_.A * x + problem_.c).squaredNorm();
  }

  // Two evaluations for every unknown, which is nearly all that a search takes.
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
    const bool is_first = slopes_at_.size() == 0;
    curvature_.Take(at_.x, at_.residuals, at_.jacobian,
                    !is_first && IsLongEnough(at_.x - slopes_at_, kEnoughForCurvature));
    slopes_at_ = at_.x;
    slopes_are_taken_ = true;
    Linearise();
  }

  bool IsLongEnough(const VectorXd& step, double share) const {
    return (step.cwiseAbs().array() > share * problem_.steps.array()).any();
  }

  // What the last step has shown about them (Broyden 1965), where it was long enough to.
  void LearnSlopes() {
    if (IsLongEnough(last_step_, kEnoughForSlopes)) {
      at_.jacobian += (last_change_ - at_.jacobian * last_step_) * last_step_.transpose() /
                      last_step_.squaredNorm();
      slopes_are_taken_ = false;
    }
    Linearise();
  }

  void Linearise() {
    normal_ = at_.jacobian.transpose() * at_.jacobian + prior_;
    gradient_ = at_.jacobian.transpose() * at_.residuals +
                problem_.A.transpose() * (problem_.A * at_.x + problem_.c);
  }

  // So near that where the search ends does not depend on which of the two they are taken at.
  bool SlopesAreOfHere() const {
    return slopes_are_taken_ &&
           (at_.x - slopes_at_).cwiseAbs().maxCoeff() <= kSlopesHold * problem_.smallest_move;
  }

  Step StepDown() {
    const VectorXd lower = problem_.lower - at_.x;
    const VectorXd upper = problem_.upper - at_.x;
    const bool slopes_are_of_here = SlopesAreOfHere();
    for (; damping_ < kMaxDamping; damping_ *= 10) {
      const MatrixXd model = curvature_.AddedTo(normal_);
      MatrixXd H = model;
      // The unknowns have one scale, so the plain form: Marquardt's would not hold those that
      // nothing depends on.
      H.diagonal().array() += damping_ * std::max(normal_.diagonal().maxCoeff(), 1e-12);
      const VectorXd step = SolveBoxProgram(H, gradient_, lower, upper);
      const double expected = -step.dot(2 * gradient_ + model * step);
      const bool is_short =
          step.cwiseAbs().maxCoeff() <= problem_.smallest_move || expected <= kRounding * value_;
      const VectorXd x = (at_.x + step).cwiseMax(problem_.lower).cwiseMin(problem_.upper);
      const VectorXd residuals = problem_.residuals(x);
      const double value = Value(x, residuals);
      curvature_.Compare(step, value_ - value, -step.dot(2 * gradient_ + normal_ * step));
      if (value < value_) {
        const bool is_poor = value_ - value < kLeastOfPromise * expected;
        last_step_ = x - at_.x;
        last_change_ = residuals - at_.residuals;
        at_.x = x;
        at_.residuals = residuals;
        value_ = value;
        damping_ = std::max(damping_ / 10, kLeastDamping);
        return is_short ? Step::kShort : is_poor ? Step::kPoor : Step::kGood;
      }
      // Slopes of elsewhere may be why.
      if (is_short || !slopes_are_of_here) return Step::kNone;
    }
    return Step::kNone;
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
  ResidualCurvature curvature_;
  VectorXd slopes_at_;             // where they were taken
  bool slopes_are_taken_ = false;  // and have not learned since
  VectorXd last_step_;
  VectorXd last_change_;  // of the residuals
  double damping_ = kFirstDamping;
};

}  // namespace

LeastSquaresSolution SolveBoundedLeastSquares(const LeastSquaresProblem& problem,
                                              const VectorXd& start) {
  return Search(problem, start).Run();
}

}  // namespace tissueform
