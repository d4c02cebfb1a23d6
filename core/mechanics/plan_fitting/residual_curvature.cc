// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/plan_fitting/residual_curvature.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

namespace tissueform {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// Of the gradient's change along the step: less cannot be divided by.
constexpr double kLeastAlong = 1e-3;

}  // namespace

void ResidualCurvature::Take(const VectorXd& x, const VectorXd& residuals, const MatrixXd& jacobian,
                             bool learn) {
  const VectorXd gradient = jacobian.transpose() * residuals;
  if (learn) {
    const VectorXd step = x - x_;
    const VectorXd bent = (jacobian - jacobian_).transpose() * residuals;
    const VectorXd all = gradient - gradient_;
    const double along = all.dot(step);
    if (along > kLeastAlong * all.norm() * step.norm()) {
      // Sized first: what was learned where more was missed is too much here.
      const double held = step.dot(matrix_ * step);
      if (held != 0) matrix_ *= std::min(1.0, std::abs(step.dot(bent) / held));
      const VectorXd miss = bent - matrix_ * step;
      matrix_ += (miss * all.transpose() + all * miss.transpose()) / along -
                 miss.dot(step) / (along * along) * all * all.transpose();
    }
  }
  x_ = x;
  gradient_ = gradient;
  jacobian_ = jacobian;
}

MatrixXd ResidualCurvature::AddedTo(const MatrixXd& normal) const {
  if (!is_used_) return normal;
  MatrixXd sum = normal + matrix_;
  return sum.llt().info() == Eigen::Success ? sum : normal;
}

void ResidualCurvature::Compare(const VectorXd& step, double gain, double expected) {
  const double with_bending = expected - step.dot(matrix_ * step);
  is_used_ = std::abs(gain - with_bending) <= std::abs(gain - expected);
}

}  // namespace tissueform
