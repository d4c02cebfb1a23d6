// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "core/base/workspace_pool.h"
#include "core/mechanics/linear_solvers/sparse_cholesky.h"

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

  void Solve(const Eigen::VectorXf& rhs, Eigen::VectorXf* solution) const override;

 private:
  // The dense block of a supernode and where its rows lie.
  struct Block {
    int columns;
    int rows_below;
    const float* values;  // (columns + rows_below) by columns
    float* x;             // of its own columns
    const int32_t* below;
  };

  struct Workspace {
    Eigen::VectorXf x;      // in the order of the factor
    Eigen::VectorXf below;  // of the rows below a supernode
  };

  Block BlockOf(size_t supernode, Workspace* workspace) const;
  void SolveDown(Workspace* workspace) const;
  void SolveUp(Workspace* workspace) const;

  // Constant after the constructor.
  const SupernodalFactor factor_;
  const Eigen::Index largest_row_count_;

  // Self-synchronised.
  mutable WorkspacePool<Workspace> workspaces_;
};

}  // namespace tissueform
