// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>

#include "core/mechanics/linear_solvers/sparse_cholesky.h"

namespace tissueform {

// CHOLMOD's supernodal Cholesky with METIS ordering.
std::unique_ptr<SparseCholesky> CreateCholmodCholesky(OrderingHints hints);

}  // namespace tissueform
