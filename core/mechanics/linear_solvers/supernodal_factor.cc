// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/linear_solvers/supernodal_factor.h"

#include <algorithm>
#include <utility>

// Of the BLAS, in Fortran's way of calling; declared here because cblas.h clashes with others.
extern "C" {
void strsv_(const char* uplo, const char* trans, const char* diag, const int* n, const float* a,
            const int* lda, float* x, const int* incx);
void sgemv_(const char* trans, const int* m, const int* n, const float* alpha, const float* a,
            const int* lda, const float* x, const int* incx, const float* beta, float* y,
            const int* incy);
}

namespace tissueform {
namespace {

constexpr int kOne = 1;
constexpr float kPlus = 1;
constexpr float kMinus = -1;
constexpr float kZero = 0;

Eigen::Index LargestRowCount(const SupernodalFactor& factor) {
  int32_t largest = 0;
  for (size_t s = 0; s + 1 < factor.first_rows.size(); ++s) {
    largest = std::max(largest, factor.first_rows[s + 1] - factor.first_rows[s]);
  }
  return largest;
}

}  // namespace

SupernodalSolver::SupernodalSolver(SupernodalFactor factor)
    : factor_(std::move(factor)), largest_row_count_(LargestRowCount(factor_)) {}

SupernodalSolver::Block SupernodalSolver::BlockOf(size_t supernode, Workspace* workspace) const {
  const int32_t first_column = factor_.first_columns[supernode];
  const int32_t first_row = factor_.first_rows[supernode];
  const int columns = factor_.first_columns[supernode + 1] - first_column;
  return {.columns = columns,
          .rows_below = factor_.first_rows[supernode + 1] - first_row - columns,
          .values = factor_.values.data() + factor_.first_values[supernode],
          .x = workspace->x.data() + first_column,
          .below = factor_.rows.data() + first_row + columns};
}

void SupernodalSolver::Solve(const Eigen::VectorXf& rhs, Eigen::VectorXf* solution) const {
  const WorkspacePool<Workspace>::Lease workspace = workspaces_.Borrow();
  workspace->below.resize(largest_row_count_);
  workspace->x = rhs(factor_.permutation);
  SolveDown(&*workspace);
  SolveUp(&*workspace);
  solution->resize(workspace->x.size());
  (*solution)(factor_.permutation) = workspace->x;
}

void SupernodalSolver::SolveDown(Workspace* workspace) const {
  Eigen::VectorXf& x = workspace->x;
  Eigen::VectorXf& below = workspace->below;
  // CHOLMOD 3 solves in double precision only. Its supernodes are dense blocks, so the level 2 BLAS
  // reads each once, at the speed of memory: half the bytes are half the time.
  for (size_t s = 0; s + 1 < factor_.first_columns.size(); ++s) {
    const Block block = BlockOf(s, workspace);
    const int leading = block.columns + block.rows_below;
    strsv_("L", "N", "N", &block.columns, block.values, &leading, block.x, &kOne);
    if (block.rows_below == 0) continue;
    sgemv_("N", &block.rows_below, &block.columns, &kPlus, block.values + block.columns, &leading,
           block.x, &kOne, &kZero, below.data(), &kOne);
    for (int i = 0; i < block.rows_below; ++i) {
      x[block.below[i]] -= below[i];
    }
  }
}

void SupernodalSolver::SolveUp(Workspace* workspace) const {
  const Eigen::VectorXf& x = workspace->x;
  Eigen::VectorXf& below = workspace->below;
  for (size_t s = factor_.first_columns.size() - 1; s-- > 0;) {
    const Block block = BlockOf(s, workspace);
    const int leading = block.columns + block.rows_below;
    // Gathered first, so that the product runs over neighbouring numbers.
    for (int i = 0; i < block.rows_below; ++i) {
      below[i] = x[block.below[i]];
    }
    if (block.rows_below > 0) {
      sgemv_("T", &block.rows_below, &block.columns, &kMinus, block.values + block.columns,
             &leading, below.data(), &kOne, &kPlus, block.x, &kOne);
    }
    strsv_("L", "T", "N", &block.columns, block.values, &leading, block.x, &kOne);
  }
}

}  // namespace tissueform
