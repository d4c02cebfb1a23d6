// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/linear_solvers/eigen_cholesky.h"

#include <limits>
#include <new>
#include <vector>

#include <Eigen/SparseCholesky>

#include "core/base/error_reason.h"

namespace tissueform {
namespace {

// SimplicialLLT with its symbolic result in reach: the column pointers of the factor are known
// after the analysis, which gives the bytes before the numeric work.
class SimplicialFactor : public Eigen::SimplicialLLT<SparseMatrix> {
 public:
  int64_t PredictedEntries() const { return m_matrix.outerIndexPtr()[m_matrix.cols()]; }
};

class SimplicialSolver : public SinglePrecisionSolver {
 public:
  using Factor = Eigen::SparseMatrix<float, Eigen::ColMajor, int32_t>;
  using Permutation = Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int32_t>;

  // Eigen 3.4's sparse matrices cannot be moved.
  SimplicialSolver(const Factor& factor, const Permutation& permutation)
      : factor_(factor), permutation_(permutation) {}

  void Solve(const Eigen::VectorXf& rhs, Eigen::VectorXf* solution) const override {
    Eigen::VectorXf x = permutation_ * rhs;
    factor_.triangularView<Eigen::Lower>().solveInPlace(x);
    factor_.transpose().triangularView<Eigen::Upper>().solveInPlace(x);
    *solution = permutation_.inverse() * x;
  }

 private:
  const Factor factor_;
  const Permutation permutation_;
};

class EigenCholesky : public SparseCholesky {
 public:
  absl::Status Analyze(const SparseMatrix& A) override {
    if (A.rows() != A.cols()) {
      return absl::InvalidArgumentError("matrix of the linear system is not square");
    }
    try {
      factor_.analyzePattern(A);
    } catch (const std::bad_alloc&) {
      return absl::ResourceExhaustedError("out of memory while analyzing the linear system");
    }
    return absl::OkStatus();
  }

  const std::vector<int32_t>& node_order() const override {
    static const std::vector<int32_t> none;
    return none;
  }

  int64_t factor_bytes() const override {
    return factor_.PredictedEntries() * static_cast<int64_t>(sizeof(double) + sizeof(int32_t));
  }

  absl::Status Factorize(const SparseMatrix& A) override {
    try {
      factor_.factorize(A);
    } catch (const std::bad_alloc&) {
      return absl::ResourceExhaustedError("out of memory while factorizing the linear system");
    }
    if (factor_.info() != Eigen::Success) {
      return WithReason(absl::FailedPreconditionError("linear system is not positive definite"),
                        ErrorReason::kNotPositiveDefinite);
    }
    return absl::OkStatus();
  }

  absl::Status Solve(const Eigen::MatrixXd& rhs, Eigen::MatrixXd* solution) const override {
    *solution = factor_.solve(rhs);
    return absl::OkStatus();
  }

  absl::StatusOr<std::unique_ptr<SinglePrecisionSolver>> ToSinglePrecision() const override {
    try {
      SimplicialSolver::Factor factor = factor_.matrixL().nestedExpression().cast<float>();
      const Eigen::ArrayXf pivots = factor.diagonal();
      if (!(pivots >= std::numeric_limits<float>::min()).all() || !pivots.isFinite().all()) {
        return absl::FailedPreconditionError("a pivot is outside the range of single precision");
      }
      return std::make_unique<SimplicialSolver>(factor, factor_.permutationP());
    } catch (const std::bad_alloc&) {
      return absl::ResourceExhaustedError("out of memory while rounding the factor");
    }
  }

  int64_t single_precision_bytes() const override {
    return factor_.PredictedEntries() * static_cast<int64_t>(sizeof(float) + sizeof(int32_t));
  }

 private:
  SimplicialFactor factor_;
};

}  // namespace

std::unique_ptr<SparseCholesky> CreateEigenCholesky() { return std::make_unique<EigenCholesky>(); }

}  // namespace tissueform
