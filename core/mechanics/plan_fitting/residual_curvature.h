// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <Eigen/Core>

namespace tissueform {

// What the residuals' own bending adds to J^T J in the second derivatives of |r|^2 / 2: the sum of
// r_i times the second derivatives of r_i. Where targets cannot be met it is not small beside that
// of flat directions, and a search without it creeps. Learned from slopes that were taken at two
// places, by the update of Dennis, Gay and Welsch (1981).
class ResidualCurvature {
 public:
  explicit ResidualCurvature(Eigen::Index num_unknowns)
      : matrix_(Eigen::MatrixXd::Zero(num_unknowns, num_unknowns)) {}

  // Slopes were taken at x; `learn`: those before lie far enough from here to show bending.
  void Take(const Eigen::VectorXd& x, const Eigen::VectorXd& residuals,
            const Eigen::MatrixXd& jacobian, bool learn);

  // `normal` with the bending, where that is positive definite and predicted the last step better.
  Eigen::MatrixXd AddedTo(const Eigen::MatrixXd& normal) const;

  // A step lowered |r|^2 + ... by `gain` (negative: raised it), where without bending the slopes
  // predicted `expected`.
  void Compare(const Eigen::VectorXd& step, double gain, double expected);

 private:
  Eigen::MatrixXd matrix_;
  bool is_used_ = true;
  // Where slopes were taken last.
  Eigen::VectorXd x_;
  Eigen::VectorXd gradient_;  // J^T r
  Eigen::MatrixXd jacobian_;
};

}  // namespace tissueform
