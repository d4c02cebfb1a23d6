// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/linear_solvers/sparse_cholesky.h"

#include <utility>

#include "core/mechanics/linear_solvers/cholmod_cholesky.h"
#include "core/mechanics/linear_solvers/eigen_cholesky.h"

namespace tissueform {

std::unique_ptr<SparseCholesky> CreateSparseCholesky(CholeskyBackend backend, OrderingHints hints) {
  // The one place that knows which backends there are; a new one is a new file and a new case.
  switch (backend) {
    case CholeskyBackend::kCholmod:
      return CreateCholmodCholesky(std::move(hints));
    case CholeskyBackend::kEigen:
      break;
  }
  return CreateEigenCholesky();
}

}  // namespace tissueform
