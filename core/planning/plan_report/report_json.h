// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "nlohmann/json.hpp"

#include "core/planning/plan_building/plan_builder.h"
#include "core/planning/plan_report/plan_measures.h"
#include "core/planning/plan_report/plan_pictures.h"

namespace tissueform {

// report.json (docs/recipe-format.md defines its keys).
nlohmann::ordered_json PlanReportJson(const PlanBuild& build, const PlanMeasures& measures,
                                      const std::string& program_version,
                                      const std::vector<ReportPicture>& pictures);

}  // namespace tissueform
