// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/benchmarks/direct_cholmod.h"

#include <cstdint>
#include <cstdio>
#include <cstdlib>

#include "cholmod.h"

namespace tissueform::benchmarks {

struct DirectCholmod::State {
  cholmod_common common{};
  cholmod_factor* factor = nullptr;
  cholmod_dense* solution = nullptr;
  cholmod_dense* workspace_y = nullptr;
  cholmod_dense* workspace_e = nullptr;
};

namespace {

void RequireOk(const cholmod_common& common, const char* doing) {
  if (common.status != CHOLMOD_OK) {
    std::fprintf(stderr, "direct CHOLMOD: status %d while %s\n", common.status, doing);
    std::abort();
  }
}

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

}  // namespace

DirectCholmod::DirectCholmod() : state_(std::make_unique<State>()) {
  cholmod_common& common = state_->common;
  cholmod_start(&common);
  // Ours to the letter (core/mechanics/linear_solvers/cholmod_cholesky.cc): the ratio shows what
  // lies around the library, not which ordering is luckier.
  common.supernodal = CHOLMOD_SUPERNODAL;
  common.nmethods = 1;
  common.method[0].ordering = CHOLMOD_METIS;
  common.postorder = 1;
}

DirectCholmod::~DirectCholmod() {
  cholmod_free_dense(&state_->solution, &state_->common);
  cholmod_free_dense(&state_->workspace_y, &state_->common);
  cholmod_free_dense(&state_->workspace_e, &state_->common);
  cholmod_free_factor(&state_->factor, &state_->common);
  cholmod_finish(&state_->common);
}

void DirectCholmod::Analyse(const SparseMatrix& A) {
  cholmod_sparse view = ViewLowerTriangle(A);
  cholmod_free_factor(&state_->factor, &state_->common);
  state_->factor = cholmod_analyze(&view, &state_->common);
  RequireOk(state_->common, "analysing");
}

void DirectCholmod::Factorise(const SparseMatrix& A) {
  cholmod_sparse view = ViewLowerTriangle(A);
  cholmod_factorize(&view, state_->factor, &state_->common);
  RequireOk(state_->common, "factorising");
}

Eigen::Map<const Eigen::MatrixXd> DirectCholmod::Solve(const Eigen::MatrixXd& rhs) {
  cholmod_dense view{};
  view.nrow = static_cast<size_t>(rhs.rows());
  view.ncol = static_cast<size_t>(rhs.cols());
  view.nzmax = static_cast<size_t>(rhs.size());
  view.d = static_cast<size_t>(rhs.rows());
  view.x = const_cast<double*>(rhs.data());
  view.xtype = CHOLMOD_REAL;
  view.dtype = CHOLMOD_DOUBLE;

  cholmod_solve2(CHOLMOD_A, state_->factor, &view, nullptr, &state_->solution, nullptr,
                 &state_->workspace_y, &state_->workspace_e, &state_->common);
  RequireOk(state_->common, "solving");
  return {static_cast<const double*>(state_->solution->x), rhs.rows(), rhs.cols()};
}

}  // namespace tissueform::benchmarks
