// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/statusor.h"

#include "client/lab/benchmarks/benchmark_report.h"
#include "client/lab/benchmarks/test_bars.h"

namespace tissueform::benchmarks {

// Runs tissueform-memory-probe, which lies beside this program.
//
// Errors: NotFound (no such program), Internal (it failed).
absl::StatusOr<MemoryUse> MeasureMemory(const TestBar& bar, int threads);

}  // namespace tissueform::benchmarks
