// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

#include "client/lab/benchmarks/benchmark_report.h"

namespace tissueform::benchmarks {

// The problems on which whole programs are compared: bundled plans, numbered on after the bars.
inline constexpr int kBlock = 7;
inline constexpr int kTongue = 8;

std::string ProcessProblemName(int number);

// `tissueform deform --model neo_hookean` against `ccx` with the same mesh and law, both from start
// to end of their processes, in turns; medians. The answers must agree to a thousandth of the
// largest displacement.
//
// Errors: NotFound without ccx; Internal when the answers do not agree.
absl::StatusOr<BenchmarkRow> MeasureAgainstCalculix(int number, int repetitions, int threads);

}  // namespace tissueform::benchmarks
