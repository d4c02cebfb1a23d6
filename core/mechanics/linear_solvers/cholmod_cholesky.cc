// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/linear_solvers/cholmod_cholesky.h"

#include <cmath>
#include <limits>
#include <mutex>
#include <new>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

#include "cholmod.h"
#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "core/base/workspace_pool.h"
#include "core/mechanics/linear_solvers/supernodal_factor.h"

// Declared here because clang has no omp.h without a package of its own.
extern "C" void omp_set_max_active_levels(int levels);

namespace tissueform {
namespace {

// METIS draws its random numbers from the C library's one generator and seeds it at every call. Two
// orderings at a time would disturb each other: the answers stay right, the factors would differ
// from run to run.
std::mutex& OrderingMutex() {
  static std::mutex mutex;
  return mutex;
}

// CHOLMOD shares its copying loops out to four threads of OpenMP, however many processors there
// are; they wait for each other longer than the copying takes. (Measured: an elastic factor takes
// half the time without.) The setting is of the calling thread.
void CopyOnThisThread() { omp_set_max_active_levels(0); }

absl::Status ToStatus(int status, const std::string& doing) {
  switch (status) {
    case CHOLMOD_OK:
      return absl::OkStatus();
    case CHOLMOD_NOT_POSDEF:
      return WithReason(absl::FailedPreconditionError("linear system is not positive definite"),
                        ErrorReason::kNotPositiveDefinite);
    case CHOLMOD_OUT_OF_MEMORY:
      return absl::ResourceExhaustedError(absl::StrCat("out of memory while ", doing));
    case CHOLMOD_TOO_LARGE:
      return absl::ResourceExhaustedError(
          absl::StrCat("linear system is too large for 32-bit indices while ", doing));
    default:
      return absl::InternalError(absl::StrCat("CHOLMOD status ", status, " while ", doing));
  }
}

// Lower triangle of an Eigen matrix, seen by CHOLMOD without a copy.
cholmod_sparse ViewLowerTriangle(const SparseMatrix& A) {
  cholmod_sparse view{};
  view.nrow = static_cast<size_t>(A.rows());
  view.ncol = static_cast<size_t>(A.cols());
  view.nzmax = static_cast<size_t>(A.nonZeros());
  view.p = const_cast<int32_t*>(A.outerIndexPtr());
  view.i = const_cast<int32_t*>(A.innerIndexPtr());
  view.x = const_cast<double*>(A.valuePtr());
  view.stype = -1;
  view.itype = CHOLMOD_INT;
  view.xtype = CHOLMOD_REAL;
  view.dtype = CHOLMOD_DOUBLE;
  view.sorted = 1;
  view.packed = 1;
  return view;
}

cholmod_dense ViewDense(const Eigen::MatrixXd& matrix) {
  cholmod_dense view{};
  view.nrow = static_cast<size_t>(matrix.rows());
  view.ncol = static_cast<size_t>(matrix.cols());
  view.nzmax = static_cast<size_t>(matrix.size());
  view.d = static_cast<size_t>(matrix.rows());
  view.x = const_cast<double*>(matrix.data());
  view.xtype = CHOLMOD_REAL;
  view.dtype = CHOLMOD_DOUBLE;
  return view;
}

// The pattern of A's lower triangle between nodes of b unknowns each.
SparseMatrix NodePattern(const SparseMatrix& A, int b) {
  SparseMatrix pattern(A.rows() / b, A.cols() / b);
  pattern.reserve(A.nonZeros() / b);
  for (Eigen::Index node = 0; node < pattern.cols(); ++node) {
    pattern.startVec(node);
    int32_t last = -1;
    // The first of a node's columns holds the rows of all its neighbours.
    for (SparseMatrix::InnerIterator entry(A, node * b); entry; ++entry) {
      if (const int32_t row = entry.row() / b; row > last) {
        pattern.insertBack(row, node) = 1;
        last = row;
      }
    }
  }
  pattern.finalize();
  return pattern;
}

std::vector<int32_t> OrderOfUnknowns(const std::vector<int32_t>& node_order, int b) {
  std::vector<int32_t> order;
  order.reserve(node_order.size() * static_cast<size_t>(b));
  for (const int32_t node : node_order) {
    for (int k = 0; k < b; ++k) order.push_back(node * b + k);
  }
  return order;
}

absl::Status CheckPivots(const SupernodalFactor& factor) {
  for (size_t s = 0; s + 1 < factor.first_columns.size(); ++s) {
    const int32_t columns = factor.first_columns[s + 1] - factor.first_columns[s];
    const int32_t leading = factor.first_rows[s + 1] - factor.first_rows[s];
    for (int32_t c = 0; c < columns; ++c) {
      const float pivot = factor.values[factor.first_values[s] + int64_t{c} * (leading + 1)];
      if (!(pivot >= std::numeric_limits<float>::min() && std::isfinite(pivot))) {
        return absl::FailedPreconditionError("a pivot is outside the range of single precision");
      }
    }
  }
  return absl::OkStatus();
}

// What solving writes to beside the solution; the factor is only read. Kept between solves:
// cholmod_solve2 allocates it once.
struct SolveWorkspace {
  SolveWorkspace() {
    cholmod_start(&common);
    common.print = 0;
    common.error_handler = nullptr;
  }
  ~SolveWorkspace() {
    cholmod_free_dense(&y, &common);
    cholmod_free_dense(&e, &common);
    cholmod_finish(&common);
  }
  SolveWorkspace(const SolveWorkspace&) = delete;
  SolveWorkspace& operator=(const SolveWorkspace&) = delete;

  cholmod_common common{};
  cholmod_dense* y = nullptr;
  cholmod_dense* e = nullptr;
};

class CholmodCholesky : public SparseCholesky {
 public:
  explicit CholmodCholesky(OrderingHints hints) : hints_(std::move(hints)) {
    cholmod_start(&common_);
    // Always supernodal: CHOLMOD would choose otherwise for small matrices, and SupernodalSolver
    // needs the dense blocks.
    common_.supernodal = CHOLMOD_SUPERNODAL;
    common_.nmethods = 1;
    common_.method[0].ordering = CHOLMOD_GIVEN;
    common_.postorder = 1;
    common_.print = 0;
    common_.error_handler = nullptr;
  }

  ~CholmodCholesky() override {
    cholmod_free_factor(&factor_, &common_);
    cholmod_finish(&common_);
  }

  CholmodCholesky(const CholmodCholesky&) = delete;
  CholmodCholesky& operator=(const CholmodCholesky&) = delete;

  absl::Status Analyze(const SparseMatrix& A) override {
    if (A.rows() != A.cols()) {
      return absl::InvalidArgumentError("matrix of the linear system is not square");
    }
    cholmod_free_factor(&factor_, &common_);
    const bool in_nodes = A.rows() % hints_.unknowns_per_node == 0;
    const int b = in_nodes ? hints_.unknowns_per_node : 1;
    if (hints_.node_order.size() == static_cast<size_t>(A.rows() / b)) {
      node_order_ = hints_.node_order;
    } else {
      TF_RETURN_IF_ERROR(FindNodeOrder(A, b));
    }
    cholmod_sparse view = ViewLowerTriangle(A);
    std::vector<int32_t> order = OrderOfUnknowns(node_order_, b);
    factor_ = cholmod_analyze_p(&view, order.data(), nullptr, 0, &common_);
    return ToStatus(common_.status, "analyzing the linear system");
  }

  const std::vector<int32_t>& node_order() const override { return node_order_; }

  int64_t factor_bytes() const override {
    return static_cast<int64_t>(factor_->xsize * sizeof(double) +
                                (factor_->ssize + 2 * factor_->n) * sizeof(int32_t));
  }

  absl::Status Factorize(const SparseMatrix& A) override {
    cholmod_sparse view = ViewLowerTriangle(A);
    CopyOnThisThread();
    cholmod_factorize(&view, factor_, &common_);
    return ToStatus(common_.status, "factorizing the linear system");
  }

  absl::Status Solve(const Eigen::MatrixXd& rhs, Eigen::MatrixXd* solution) const override {
    const WorkspacePool<SolveWorkspace>::Lease workspace = workspaces_.Borrow();
    solution->resize(rhs.rows(), rhs.cols());
    cholmod_dense view = ViewDense(rhs);
    // Of the right size already, so CHOLMOD writes into it instead of allocating one of its own.
    cholmod_dense result = ViewDense(*solution);
    cholmod_dense* result_handle = &result;
    cholmod_solve2(CHOLMOD_A, factor_, &view, nullptr, &result_handle, nullptr, &workspace->y,
                   &workspace->e, &workspace->common);
    return ToStatus(workspace->common.status, "solving the linear system");
  }

  absl::StatusOr<std::unique_ptr<SinglePrecisionSolver>> ToSinglePrecision() const override {
    SupernodalFactor factor;
    try {
      factor = RoundedFactor();
    } catch (const std::bad_alloc&) {
      return absl::ResourceExhaustedError("out of memory while rounding the factor");
    }
    TF_RETURN_IF_ERROR(CheckPivots(factor));
    return std::make_unique<SupernodalSolver>(std::move(factor));
  }

  int64_t single_precision_bytes() const override {
    const size_t indices = factor_->ssize + 3 * (factor_->nsuper + 1) + factor_->n;
    const size_t workspace = 2 * factor_->n;
    return static_cast<int64_t>((factor_->xsize + workspace) * sizeof(float) +
                                indices * sizeof(int32_t));
  }

 private:
  SupernodalFactor RoundedFactor() const {
    const auto indices = [](const void* data, size_t size) {
      const auto* begin = static_cast<const int32_t*>(data);
      return std::vector<int32_t>(begin, begin + size);
    };
    const auto* values = static_cast<const double*>(factor_->x);
    return {.permutation = indices(factor_->Perm, factor_->n),
            .first_columns = indices(factor_->super, factor_->nsuper + 1),
            .first_rows = indices(factor_->pi, factor_->nsuper + 1),
            .first_values = indices(factor_->px, factor_->nsuper + 1),
            .rows = indices(factor_->s, factor_->ssize),
            .values = std::vector<float>(values, values + factor_->xsize)};
  }

  // The displacements of a vertex have the same neighbours, so an ordering of the vertices orders
  // the unknowns, and its graph has b * b times fewer entries.
  //
  // METIS alone: measured on the largest bar of the benchmarks (262,701 vertices) its ordering
  // gives a factor in 9.7 s, that of AMD in 26 s; to try several would cost all of them in every
  // analysis.
  absl::Status FindNodeOrder(const SparseMatrix& A, int b) {
    const SparseMatrix pattern = NodePattern(A, b);
    cholmod_sparse nodes = ViewLowerTriangle(pattern);
    node_order_.resize(static_cast<size_t>(pattern.cols()));
    const std::lock_guard lock(OrderingMutex());
    cholmod_metis(&nodes, nullptr, 0, 0, node_order_.data(), &common_);
    return ToStatus(common_.status, "ordering the linear system");
  }

  const OrderingHints hints_;
  std::vector<int32_t> node_order_;
  cholmod_common common_{};
  cholmod_factor* factor_ = nullptr;
  mutable WorkspacePool<SolveWorkspace> workspaces_;
};

}  // namespace

std::unique_ptr<SparseCholesky> CreateCholmodCholesky(OrderingHints hints) {
  return std::make_unique<CholmodCholesky>(std::move(hints));
}

}  // namespace tissueform
