// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/types.h"

namespace tissueform {

enum class CholeskyBackend {
  kCholmod,  // supernodal with METIS ordering; the default
  kEigen,    // Eigen::SimplicialLLT with AMD ordering; the independent second opinion
};

// Solves A x = b nearly, with a Cholesky factor rounded to single precision: a back-substitution is
// bound by reading the factor, and this one reads half as much. The rounded factor is that of a
// matrix that is positive definite, too, and differs from A by some 1e-7 of A's size: what a
// preconditioner needs. Thread-safe.
class SinglePrecisionSolver {
 public:
  virtual ~SinglePrecisionSolver() = default;

  // `rhs` has one entry a row of A; `solution` is resized.
  virtual void Solve(const Eigen::VectorXf& rhs, Eigen::VectorXf* solution) const = 0;
};

// Direct solver for A x = b with A sparse, symmetric and positive definite.
//
// The calls come in the order Analyze, Factorize, Solve; a later Factorize with the same sparsity
// pattern reuses the analysis. One thread at a time; once factorised, several may solve at once.
class SparseCholesky {
 public:
  virtual ~SparseCholesky() = default;

  // Finds the fill-reducing ordering and the shape of the factor. Only the lower triangle of `A` is
  // read. Errors: InvalidArgument (not square), ResourceExhausted (out of memory, or the factor is
  // too large).
  virtual absl::Status Analyze(const SparseMatrix& A) = 0;

  // The fill-reducing order of A's nodes that the last analysis has found or was given, before it
  // was postordered: the same order again gives the same factor, bit by bit. Empty where the
  // backend keeps none. Known once Analyze has succeeded.
  virtual const std::vector<int32_t>& node_order() const = 0;

  // Bytes that the numeric factor will hold, or holds. Known once Analyze has succeeded, before
  // anything of that size is allocated.
  virtual int64_t factor_bytes() const = 0;

  // Computes the numeric factor. REQUIRES: Analyze succeeded for the sparsity pattern of `A`.
  // Errors: FailedPrecondition (not positive definite), ResourceExhausted (out of memory).
  virtual absl::Status Factorize(const SparseMatrix& A) = 0;

  // Solves for all columns of `rhs` (#rows by k) in one pass over the factor and writes `solution`
  // (#rows by k, resized). REQUIRES: Factorize succeeded.
  virtual absl::Status Solve(const Eigen::MatrixXd& rhs, Eigen::MatrixXd* solution) const = 0;

  // A solver of its own with the factor in single precision, and the bytes that it holds.
  // REQUIRES: Factorize succeeded. Errors: FailedPrecondition (a pivot is outside the range of
  // single precision), ResourceExhausted (out of memory).
  virtual absl::StatusOr<std::unique_ptr<SinglePrecisionSolver>> ToSinglePrecision() const = 0;
  virtual int64_t single_precision_bytes() const = 0;
};

// What is known of the matrices beforehand. Hints: a backend may pass them over.
struct OrderingHints {
  // b: rows b i to b i + b - 1 of every matrix belong to node i and are coupled to the same others
  // (the displacements of a vertex), so ordering the nodes, which takes a fraction of the time,
  // orders the rows.
  int unknowns_per_node = 1;
  // A permutation of the nodes to eliminate them by, see SparseCholesky::node_order. Empty, or of
  // another number of nodes: one is looked for.
  std::vector<int32_t> node_order = {};
};

// Never null.
std::unique_ptr<SparseCholesky> CreateSparseCholesky(CholeskyBackend backend,
                                                     OrderingHints hints = {});

}  // namespace tissueform
