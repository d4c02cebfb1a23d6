// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>

namespace tissueform {

// What is done before a mesh can be deformed, in this order; what is there already is left out.
enum class PreparationStage {
  kAssembling,
  kOrdering,     // and the symbolic analysis
  kFactorising,  // and the estimate of the condition
  kResponses,  // what poses are answered with: harmonic fields, or the columns of an elastic system
  kAnswers,    // columns of prepared answers
};

struct PreparationProgress {
  PreparationStage stage = PreparationStage::kAssembling;
  int64_t step = 0;   // so many columns are done
  int64_t steps = 0;  // of so many; 0: the stage does not count
};

// Progress of long work: passed down to the work, which calls it on its own thread when a stage
// begins and after each step of a stage that counts steps. May be empty. It must not take long;
// what it refers to must outlive the work. (A Cancellation says whether a caller still waits.)
using PreparationObserver = std::function<void(const PreparationProgress& progress)>;

inline void ReportProgress(const PreparationObserver& observer, PreparationStage stage,
                           int64_t step = 0, int64_t steps = 0) {
  if (observer) observer({stage, step, steps});
}

}  // namespace tissueform
