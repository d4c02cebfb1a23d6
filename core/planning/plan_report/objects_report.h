// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "nlohmann/json.hpp"

#include "core/planning/plan_building/plan_builder.h"
#include "core/planning/plan_report/plan_measures.h"

namespace tissueform {

// What the report states about things that touched the head and were taken from it.

// No piece that may hold a part of the face lay on the skin of the region of interest: coverage
// counts only the skin that is left.
QualityCheck CheckObjects(const PlanBuild& build);

// A sentence for each thing that touched the skin of the region of interest: what it is, its
// volume, and where and on how many cm2 the skin under it is not seen.
std::vector<std::string> ObjectsCautions(const PlanBuild& build);

// The key "removed_objects" of report.json's "head" (docs/recipe-format.md).
nlohmann::ordered_json ObjectsJson(const PlanBuild& build);

}  // namespace tissueform
