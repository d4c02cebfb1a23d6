// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <deque>
#include <functional>

#include "absl/status/statusor.h"
#include <Eigen/Core>

namespace tissueform {

// The last steps of a limited-memory BFGS iteration (Nocedal and Wright 2006, algorithm 7.4) whose
// first inverse Hessian is a linear solver of the caller's (Liu, Bouaziz, Kavan 2017).
class LbfgsHistory {
 public:
  // rhs -> solution of a fixed symmetric positive definite system.
  using InitialInverse = std::function<absl::StatusOr<Eigen::VectorXd>(const Eigen::VectorXd& rhs)>;

  // `length` pairs are kept.
  explicit LbfgsHistory(int length) : length_(static_cast<size_t>(length)) {}

  // A step and the change of the gradient over it. Left out when the curvature along the step is
  // not clearly positive, which keeps every direction one of descent.
  void Add(Eigen::VectorXd step, Eigen::VectorXd gradient_change);

  // The inverse Hessian so far times `gradient`; to be walked against. One linear solve.
  absl::StatusOr<Eigen::VectorXd> Apply(const Eigen::VectorXd& gradient,
                                        const InitialInverse& initial_inverse) const;

  void Clear() { pairs_.clear(); }
  bool empty() const { return pairs_.empty(); }

 private:
  struct Pair {
    Eigen::VectorXd step;
    Eigen::VectorXd gradient_change;
    double inverse_curvature;
  };

  const size_t length_;
  std::deque<Pair> pairs_;  // the oldest first
};

}  // namespace tissueform
