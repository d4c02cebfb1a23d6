// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <Eigen/Core>

namespace tissueform {

// Solves A x = b nearly, with a Cholesky factor rounded to single precision: a back-substitution is
// bound by reading the factor, and this one reads half as much. The rounded factor is that of a
// matrix that is positive definite, too, and differs from A by some 1e-7 of A's size: what a
// preconditioner needs. One thread at a time.
class SinglePrecisionSolver {
 public:
  virtual ~SinglePrecisionSolver() = default;

  // `rhs` has one entry a row of A; `solution` is resized.
  virtual void Solve(const Eigen::VectorXf& rhs, Eigen::VectorXf* solution) = 0;
};

}  // namespace tissueform
