// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/statusor.h"

#include "client/lab/experiments/bar_translation.h"
#include "client/lab/experiments/experiment.h"

namespace tissueform {

// The three ways of Fig. 3 to move the end of a bar without turning it.
struct UpdateSchemes {
  Positions plain;                // (a)
  TranslationResult not_blended;  // (b), run to its fixed point
  TranslationResult blended;      // (c), cosine
};
absl::StatusOr<UpdateSchemes> CompareUpdateSchemes(const TranslationProblem& problem);

// Fig. 3: the three schemes with the gradients that they reconstruct from.
absl::Status RunUpdateExperiment(const ExperimentOptions& options);

}  // namespace tissueform
