// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "core/linear_solvers/sparse_cholesky.h"

namespace tissueform {

// A supernodal Cholesky factor L of P A P', as CHOLMOD lays it out (Chen et al. 2008): a supernode
// is a range of columns of L with the same rows below them, a dense block stored by columns.
struct SupernodalFactor {
  std::vector<int32_t> permutation;    // row i of P A P' is row permutation[i] of A
  std::vector<int32_t> first_columns;  // #supernodes + 1
  std::vector<int32_t> first_rows;     // #supernodes + 1, into rows
  std::vector<int32_t> first_values;   // #supernodes + 1, into values
  std::vector<int32_t> rows;           // of every supernode; its own columns come first
  std::vector<float> values;
};

// Errors do not occur. REQUIRES: a factor of the form above with positive, finite diagonals.
class SupernodalSolver : public SinglePrecisionSolver {
 public:
  explicit SupernodalSolver(SupernodalFactor factor);

  void Solve(const Eigen::VectorXf& rhs, Eigen::VectorXf* solution) override;

 private:
  // The dense block of a supernode and where its rows lie.
  struct Block {
    int columns;
    int rows_below;
    const float* values;  // (columns + rows_below) by columns
    float* x;             // of its own columns
    const int32_t* below;
  };

  Block BlockOf(size_t supernode);
  void SolveDown();
  void SolveUp();

  // Constant after the constructor.
  const SupernodalFactor factor_;

  // Workspaces.
  Eigen::VectorXf x_;      // in the order of the factor
  Eigen::VectorXf below_;  // of the rows below a supernode
};

}  // namespace tissueform
