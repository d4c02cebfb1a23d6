// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "nlohmann/json.hpp"

#include "core/planning/plan_report/plan_pictures.h"

namespace tissueform {

// report.html: one page out of report.json and the pictures beside it in "pictures". No script, and
// nothing is loaded from elsewhere; every text of the report is escaped.
std::string PlanReportHtml(const nlohmann::ordered_json& report,
                           const std::vector<ReportPicture>& pictures);

}  // namespace tissueform
