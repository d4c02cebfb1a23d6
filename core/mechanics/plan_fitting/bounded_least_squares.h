// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

namespace tissueform {

// Minimises |r(x)|^2 + |A x + c|^2 within lower <= x <= upper, for a few tens of unknowns. Scale
// them so that a unit of each means about the same.
struct LeastSquaresProblem {
  // r; of the same length at every call. Also asked a step beyond the bounds.
  std::function<Eigen::VectorXd(const Eigen::VectorXd& x)> residuals;
  Eigen::MatrixXd A;  // any number of rows, #x columns
  Eigen::VectorXd c;
  Eigen::VectorXd lower;
  Eigen::VectorXd upper;  // REQUIRES: lower <= upper
  // Of the central differences that are taken for slopes: large where r is rounded, small where it
  // is bent.
  Eigen::VectorXd steps;
  double smallest_move = 1e-6;  // of x; a search whose steps are shorter has converged
  int max_iterations = 120;     // steps; most of them take one evaluation
};

// Which bound holds an unknown that the sum would fall beyond; kNone also where it only touches.
enum class ActiveBound { kNone, kLower, kUpper };

struct LeastSquaresSolution {
  Eigen::VectorXd x;
  Eigen::VectorXd residuals;  // r(x)
  Eigen::MatrixXd jacobian;   // of r
  std::vector<ActiveBound> bounds;
  int iterations = 0;
  bool converged = false;
};

// Levenberg-Marquardt; each step is the exact answer of the damped linear problem within the
// bounds (an active-set method), so that bounds are kept at every x that counts and a step along
// them is as good as one inside. Slopes take two evaluations for every unknown, so they are updated
// from steps (Broyden), and computed again at the end and where a step wins less than promised; the
// residuals' own curvature is estimated from slopes (Dennis, Gay and Welsch). Ends where no step
// lowers the sum by more than 1e-7 of it, the limit of single precision. From `start`, which is
// moved within the bounds.
LeastSquaresSolution SolveBoundedLeastSquares(const LeastSquaresProblem& problem,
                                              const Eigen::VectorXd& start);

}  // namespace tissueform
