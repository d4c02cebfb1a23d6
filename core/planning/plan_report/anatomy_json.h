// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "nlohmann/json.hpp"

#include "core/planning/plan_building/plan_builder.h"
#include "core/planning/plan_report/plan_measures.h"

namespace tissueform {

// Keys of report.json (docs/recipe-format.md) that report what was found in the CT and how it was
// cut, before anything was meshed.

nlohmann::ordered_json HeadJson(const PlanBuild& build);
nlohmann::ordered_json BoneJson(const PlanBuild& build, const PlanMeasures& measures);
nlohmann::ordered_json LandmarksJson(const PlanBuild& build);
nlohmann::ordered_json SegmentsJson(const PlanBuild& build);
nlohmann::ordered_json RegionJson(const PlanBuild& build);
nlohmann::ordered_json SoftTissueJson(const SoftTissue& soft_tissue);

}  // namespace tissueform
