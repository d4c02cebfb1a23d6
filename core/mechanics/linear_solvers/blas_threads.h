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

// So many of them as long as this lives, then one: a command that is alone in its process makes a
// large factor with more. Back-substitutions, which are bound by reading the factor, gain nothing.
// The last digits of a factor depend on the number. As SetBlasThreads not thread-safe: never in a
// server, whose other sessions would change their digits with it.
class BlasThreadsScope {
 public:
  explicit BlasThreadsScope(int threads) { SetBlasThreads(threads); }
  ~BlasThreadsScope() { SetBlasThreads(1); }
  BlasThreadsScope(const BlasThreadsScope&) = delete;
  BlasThreadsScope& operator=(const BlasThreadsScope&) = delete;
};

// OpenBLAS chooses its kernels when it is loaded, by the model of the processor. It takes a
// processor newer than itself for one of 2004 (Prescott), with kernels that need twice as long. In
// that case, if the processor has AVX2 and FMA, this restarts the program with the kernels for
// those (Haswell), unless the environment chooses (OPENBLAS_CORETYPE); otherwise it returns. The
// first call in main, with its argv.
void RestartWithFittingBlasKernels(char** argv);

}  // namespace tissueform
