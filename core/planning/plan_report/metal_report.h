// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "nlohmann/json.hpp"

#include "core/planning/plan_building/plan_builder.h"
#include "core/planning/rendering/panels.h"

namespace tissueform {

// What the report states about metal in the mouth.

// The key "metal" of report.json (docs/recipe-format.md).
nlohmann::ordered_json MetalJson(const PlanBuild& build);

// How much metal, in which slices, and what is uncertain because of it; nothing without metal.
std::vector<std::string> MetalCautions(const PlanBuild& build);

// Axial slices through the largest pieces of metal, at most three that lie 3 mm apart: as they
// were, then as they were corrected. Empty without metal.
struct MetalSlices {
  std::vector<Picture> before;
  std::vector<Picture> after;
};
MetalSlices DrawMetalSlices(const PlanBuild& build);

}  // namespace tissueform
