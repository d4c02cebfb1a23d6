// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "nlohmann/json.hpp"

#include "client/cli/predict/plan_fit_report.h"

namespace tissueform {

// All of a fit, for programs (docs/plan-fitting.md). Numbers in mm and degrees, in the axes of the
// plan.
nlohmann::ordered_json FitReportJson(const FitReport& report);

}  // namespace tissueform
