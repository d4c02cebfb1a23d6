// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

namespace tissueform {

// Threads that one BLAS call inside a factorisation or a solve may use; for the whole process. A
// pool of workers wants one thread a worker, a lone factorisation wants all cores. Not thread-safe:
// call it at start-up.
//
// REQUIRES: threads >= 1.
void SetBlasThreads(int threads);

// OpenBLAS chooses its kernels when it is loaded, by the model of the processor. One that is newer
// than itself it takes for one of 2004 (Prescott), with kernels that need twice as long. Where
// that is so, and the processor has AVX2 and FMA, this starts the program anew with the kernels for
// those (Haswell), unless the environment chooses (OPENBLAS_CORETYPE); else it returns. The first
// call in main, with its argv.
void RestartWithFittingBlasKernels(char** argv);

}  // namespace tissueform
