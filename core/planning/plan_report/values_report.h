// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "nlohmann/json.hpp"

#include "core/planning/plan_building/plan_builder.h"
#include "core/planning/rendering/panels.h"

namespace tissueform {

// What the report states about the CT's values (HU or gray) and its field of view.

// The key "values" of report.json (docs/recipe-format.md).
nlohmann::ordered_json ValuesJson(const PlanBuild& build);

// That values are gray and stiffness does not come from them; where the cylinder of the field of
// view cuts the face, and from which distance on no face is predicted. Empty for HU without a cut.
std::vector<std::string> ValuesCautions(const PlanBuild& build);

// The histogram of gray values with the classes and thresholds. REQUIRES: build.values.gray.
Chart GrayHistogramChart(const PlanBuild& build);

}  // namespace tissueform
