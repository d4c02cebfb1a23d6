// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace tissueform::benchmarks {

// Seconds of one run of a piece of work, by part: "factorize", "solve", ...
using PartSeconds = std::map<std::string, double>;

struct TimedWork {
  std::string name;
  int runs_per_repetition = 1;  // more for what takes milliseconds: their mean counts
  std::function<absl::StatusOr<PartSeconds>()> run;
};

// Runs every piece of work `repetitions` times with Google Benchmark, repetitions of all pieces in
// random order, so that other load on the machine affects all of them alike. Warm up before.
//
// Returns the medians over repetitions as "name/part". Errors: the first one that a piece of work
// returned. REQUIRES: repetitions >= 1; one call at a time.
absl::StatusOr<PartSeconds> InterleavedMedians(const std::vector<TimedWork>& work, int repetitions);

// Seconds that a call of `work` takes.
double SecondsOf(const std::function<void()>& work);

}  // namespace tissueform::benchmarks
