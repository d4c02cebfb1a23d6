// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>

#include "core/base/types.h"

namespace tissueform::benchmarks {

// The peer: what a program gets that calls CHOLMOD itself, with the settings of
// core/mechanics/linear_solvers (supernodal, METIS ordering, postorder) and workspaces kept between
// solves.
class DirectCholmod {
 public:
  DirectCholmod();
  ~DirectCholmod();
  DirectCholmod(const DirectCholmod&) = delete;
  DirectCholmod& operator=(const DirectCholmod&) = delete;

  // Both read the lower triangle of A and keep no reference. They end the program when A is not
  // positive definite.
  void Analyse(const SparseMatrix& A);    // ordering and shape of the factor
  void Factorise(const SparseMatrix& A);  // its numbers; REQUIRES: Analyse was called for A

  // Solves for all columns; the result lives until the next call. REQUIRES: Factorise was called.
  Eigen::Map<const Eigen::MatrixXd> Solve(const Eigen::MatrixXd& rhs);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace tissueform::benchmarks
