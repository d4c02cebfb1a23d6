// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/lbfgs_history.h"

#include <utility>
#include <vector>

#include "core/base/status_macros.h"

namespace tissueform {

void LbfgsHistory::Add(Eigen::VectorXd step, Eigen::VectorXd gradient_change) {
  // The neo-Hookean energy is not convex, and a line search by Armijo alone does not promise
  // positive curvature. Measured by the cosine, so that neither the unit nor the length of a step
  // decides.
  constexpr double kSmallestCosine = 1e-10;
  const double curvature = step.dot(gradient_change);
  if (length_ == 0 || !(curvature > kSmallestCosine * step.norm() * gradient_change.norm())) {
    return;
  }
  if (pairs_.size() == length_) {
    pairs_.pop_front();
  }
  pairs_.push_back({std::move(step), std::move(gradient_change), 1.0 / curvature});
}

absl::StatusOr<Eigen::VectorXd> LbfgsHistory::Apply(const Eigen::VectorXd& gradient,
                                                    const InitialInverse& initial_inverse) const {
  // The two loops of Nocedal and Wright's algorithm 7.4, with a solve where theirs has a multiple
  // of the identity: the linear stiffness knows the mesh and the materials, which a handful of
  // pairs could not learn.
  Eigen::VectorXd direction = gradient;
  std::vector<double> weights(pairs_.size());
  for (size_t p = pairs_.size(); p-- > 0;) {
    weights[p] = pairs_[p].inverse_curvature * pairs_[p].step.dot(direction);
    direction -= weights[p] * pairs_[p].gradient_change;
  }
  TF_ASSIGN_OR_RETURN(direction, initial_inverse(direction));
  for (size_t p = 0; p < pairs_.size(); ++p) {
    const double weight =
        weights[p] - pairs_[p].inverse_curvature * pairs_[p].gradient_change.dot(direction);
    direction += weight * pairs_[p].step;
  }
  return direction;
}

}  // namespace tissueform
