// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "client/lab/benchmarks/benchmark_report.h"

namespace tissueform::benchmarks {

// For every kind of work the exponent of its growth with the number of tets: least squares of log
// seconds against log tets. None when there is only one mesh.
std::vector<Growth> GrowthExponents(const std::vector<BenchmarkRow>& rows);

// What was required of Tissueform, as far as the measured meshes say something about it.
std::vector<Target> EvaluateTargets(const BenchmarkReport& report);

}  // namespace tissueform::benchmarks
