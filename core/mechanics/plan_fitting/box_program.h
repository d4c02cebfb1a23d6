// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <Eigen/Core>

namespace tissueform {

// The d that minimises d'Hd / 2 + g'd within lower <= d <= upper, which hold 0: the active-set
// method of convex quadratic programs. Variables at a bound are released one at a time, the one
// that pulls most; every round lowers the value, so it ends. For a few tens of variables.
//
// REQUIRES: H positive definite; lower <= 0 <= upper.
Eigen::VectorXd SolveBoxProgram(const Eigen::MatrixXd& H, const Eigen::VectorXd& g,
                                const Eigen::VectorXd& lower, const Eigen::VectorXd& upper);

}  // namespace tissueform
