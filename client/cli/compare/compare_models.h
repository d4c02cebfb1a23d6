// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/status.h"

#include "client/cli/compare/comparison_report.h"

namespace tissueform {

// Predicts one plan by several models, which share operators and factors, and reports how far each
// lies from the reference: over all, over the skin, and for the fixed, the free and every handle's
// vertices, and of elastic models the band of uncertainty where the plan has ranges. A folder as
// output gets one MODEL.vtu each, as deform writes it, with the arrays distance_mm and
// difference_mm (the model minus the reference).
absl::Status CompareModels(const CompareOptions& options);

}  // namespace tissueform
