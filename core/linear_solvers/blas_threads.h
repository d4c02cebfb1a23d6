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

}  // namespace tissueform
