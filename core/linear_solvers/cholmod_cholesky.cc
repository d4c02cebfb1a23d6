// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/linear_solvers/cholmod_cholesky.h"

#include <mutex>
#include <string>

#include "absl/strings/str_cat.h"

#include "cholmod.h"

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
      return absl::FailedPreconditionError("linear system is not positive definite");
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

class CholmodCholesky : public SparseCholesky {
 public:
  CholmodCholesky() {
    cholmod_start(&common_);
    common_.supernodal = CHOLMOD_SUPERNODAL;
    common_.nmethods = 1;
    common_.method[0].ordering = CHOLMOD_METIS;
    common_.postorder = 1;
    common_.print = 0;
    common_.error_handler = nullptr;
  }

  ~CholmodCholesky() override {
    cholmod_free_dense(&workspace_y_, &common_);
    cholmod_free_dense(&workspace_e_, &common_);
    cholmod_free_factor(&factor_, &common_);
    cholmod_finish(&common_);
  }

  CholmodCholesky(const CholmodCholesky&) = delete;
  CholmodCholesky& operator=(const CholmodCholesky&) = delete;

  absl::Status Analyze(const SparseMatrix& A) override {
    if (A.rows() != A.cols()) {
      return absl::InvalidArgumentError("matrix of the linear system is not square");
    }
    cholmod_sparse view = ViewLowerTriangle(A);
    cholmod_free_factor(&factor_, &common_);
    {
      const std::lock_guard lock(OrderingMutex());
      factor_ = cholmod_analyze(&view, &common_);
    }
    return ToStatus(common_.status, "analysing the linear system");
  }

  int64_t factor_bytes() const override {
    return static_cast<int64_t>(factor_->xsize * sizeof(double) +
                                (factor_->ssize + 2 * factor_->n) * sizeof(int32_t));
  }

  absl::Status Factorize(const SparseMatrix& A) override {
    cholmod_sparse view = ViewLowerTriangle(A);
    CopyOnThisThread();
    cholmod_factorize(&view, factor_, &common_);
    return ToStatus(common_.status, "factorising the linear system");
  }

  absl::Status Solve(const Eigen::MatrixXd& rhs, Eigen::MatrixXd* solution) override {
    solution->resize(rhs.rows(), rhs.cols());
    cholmod_dense view = ViewDense(rhs);
    // Of the right size already, so CHOLMOD writes into it instead of allocating one of its own.
    cholmod_dense result = ViewDense(*solution);
    cholmod_dense* result_handle = &result;
    cholmod_solve2(CHOLMOD_A, factor_, &view, nullptr, &result_handle, nullptr, &workspace_y_,
                   &workspace_e_, &common_);
    return ToStatus(common_.status, "solving the linear system");
  }

 private:
  cholmod_common common_{};
  cholmod_factor* factor_ = nullptr;
  // Kept between solves: cholmod_solve2 allocates them once.
  cholmod_dense* workspace_y_ = nullptr;
  cholmod_dense* workspace_e_ = nullptr;
};

}  // namespace

std::unique_ptr<SparseCholesky> CreateCholmodCholesky() {
  return std::make_unique<CholmodCholesky>();
}

}  // namespace tissueform
