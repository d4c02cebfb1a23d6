// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>
#include <vector>

#include "nlohmann/json.hpp"

#include "core/planning/plan_building/plan_labels.h"

namespace tissueform {

// The key "labels" of report.json (docs/recipe-format.md); null without a label map.
nlohmann::ordered_json LabelsJson(const std::optional<PlanLabels>& labels);

// What plan build and plan check print: the Dice coefficients, the fit, and the notes; a line each.
std::string LabelsText(const PlanLabels& labels);

// Where label map and CT disagree by more than their borders' uncertainty.
std::vector<std::string> LabelsCautions(const std::optional<PlanLabels>& labels);

}  // namespace tissueform
