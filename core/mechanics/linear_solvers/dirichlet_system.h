// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/cancellation.h"
#include "core/base/preparation_progress.h"
#include "core/base/types.h"
#include "core/mechanics/linear_solvers/sparse_cholesky.h"

namespace tissueform {

// Seconds that each stage of a preparation took, and what it holds.
struct FactorizationSummary {
  double analyse_seconds = 0;
  double factorise_seconds = 0;
  int64_t factor_bytes = 0;
};

// Called after the symbolic analysis with the bytes that the numeric factor will need and before
// they are allocated. An error stops the preparation and is returned as it is: here a memory budget
// can refuse. (A Cancellation says whether a caller still waits.)
using FactorAdmission = std::function<absl::Status(int64_t factor_bytes)>;

// K x = b with prescribed values at some unknowns (Liao et al. 2009, Eq. 7): rows and columns of
// prescribed unknowns are eliminated, the free block is factorised once.
//
// Thread-safe once it is made, but for Refactorize.
class DirichletSystem {
 public:
  struct Options {
    CholeskyBackend backend = CholeskyBackend::kCholmod;
    FactorAdmission admission;  // may be empty
    // Prescribed and free unknowns, too, come in whole nodes; see OrderingHints.
    int unknowns_per_node = 1;
    // Of all nodes, see node_order(); of another number of them: passed over.
    std::vector<int32_t> node_order = {};
    PreparationObserver observer = nullptr;  // may be empty
  };

  // `K` is n by n, symmetric, both triangles stored. `prescribed` is rising and without repetition.
  // Unknowns whose column of K is empty (vertices that no tet holds) are left out of the system and
  // keep the value zero unless prescribed.
  //
  // Errors: InvalidArgument (index out of range), FailedPrecondition (free block not positive
  // definite), ResourceExhausted, Cancelled, or what the admission says.
  static absl::StatusOr<std::unique_ptr<DirichletSystem>> Create(
      const SparseMatrix& K, const std::vector<int32_t>& prescribed, const Options& options,
      const Cancellation& cancellation = {});

  // Factorises another K of the same pattern in place of the one before; the analysis stays. Not
  // while another thread uses the system. Errors: InvalidArgument (another number of unknowns or
  // entries), FailedPrecondition (not positive definite), ResourceExhausted; nothing may be solved
  // then before another call has succeeded.
  absl::Status Refactorize(const SparseMatrix& K);

  // Solves for k right-hand sides in one pass. `rhs` is n by k (rows of prescribed unknowns are not
  // read) or has no rows, which stands for zero; `values` is #prescribed by k, in the order of
  // `prescribed`. Returns n by k.
  absl::StatusOr<Eigen::MatrixXd> Solve(const Eigen::MatrixXd& rhs,
                                        const Eigen::MatrixXd& values) const;

  // A x = b on the free block alone, for `rhs` #free by k in the order of free(); `solution` is
  // resized. For iterations that keep to the free unknowns. REQUIRES: num_free() > 0.
  absl::Status SolveFree(const Eigen::MatrixXd& rhs, Eigen::MatrixXd* solution) const {
    return cholesky_->Solve(rhs, solution);
  }

  // SolveFree in single precision, as a solver of its own, and the bytes that it holds. REQUIRES:
  // num_free() > 0. Errors: those of SparseCholesky::ToSinglePrecision.
  absl::StatusOr<std::unique_ptr<SinglePrecisionSolver>> FreeInSinglePrecision() const {
    return cholesky_->ToSinglePrecision();
  }
  int64_t single_precision_bytes() const { return cholesky_->single_precision_bytes(); }

  // Condition number of the free block in the 2-norm, the largest over the smallest eigenvalue,
  // each by `iterations` steps of power iteration with A and with its inverse: an estimate from
  // below, within a small factor after some ten steps. The same at every call; 1 without free
  // unknowns.
  absl::StatusOr<double> EstimateCondition(int iterations) const;

  // Relative residual ||A x - b|| / ||b|| of the free rows, over all columns; 0 when b is zero and
  // x solves it.
  double RelativeResidual(const Eigen::MatrixXd& rhs, const Eigen::MatrixXd& solution) const;

  Eigen::Index num_unknowns() const { return size_; }
  Eigen::Index num_prescribed() const { return static_cast<Eigen::Index>(prescribed_.size()); }
  Eigen::Index num_free() const { return static_cast<Eigen::Index>(free_.size()); }
  const std::vector<int32_t>& free() const { return free_; }
  const FactorizationSummary& factorization() const { return factorization_; }
  // A permutation of all nodes, the free ones in the order in which they are eliminated and then
  // the others: the same order again, also in a system of the same nodes with other unknowns, need
  // not be looked for. Empty without free unknowns, or where the backend keeps none.
  std::vector<int32_t> node_order() const;
  int64_t bytes_held() const;

 private:
  DirichletSystem() = default;

  std::vector<int32_t> FreeNumbers() const;
  void ExtractBlocks(const SparseMatrix& K);

  // Constant after Create, but for Refactorize.
  Eigen::Index size_ = 0;
  Eigen::Index entries_ = 0;  // of K
  int unknowns_per_node_ = 1;
  std::vector<int32_t> free_;        // rising
  std::vector<int32_t> prescribed_;  // rising
  SparseMatrix free_free_;           // #free by #free: the lower triangle of A
  SparseMatrix free_prescribed_;     // #free by #prescribed
  FactorizationSummary factorization_;
  std::unique_ptr<SparseCholesky> cholesky_;
};

}  // namespace tissueform
