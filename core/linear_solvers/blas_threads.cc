// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/linear_solvers/blas_threads.h"

// OpenBLAS's own control; declared here because its header cblas.h clashes with other BLAS headers.
extern "C" void openblas_set_num_threads(int num_threads);

namespace tissueform {

void SetBlasThreads(int threads) { openblas_set_num_threads(threads); }

}  // namespace tissueform
