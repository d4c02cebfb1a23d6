// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "nlohmann/json.hpp"

#include "core/planning/plan_io.h"

// Plans that tests change in one place.
namespace tissueform::testing {

inline nlohmann::json GoodPlan() {
  return nlohmann::json::parse(R"({
    "format": "tissueform-plan", "version": 1, "unit": "mm", "coordinate_system": "LPS",
    "mesh": "mesh.vtu",
    "stiffness": {"uniform": 15000},
    "fixed": {"box_mm": {"min": [-9, -9, -9], "max": [9, 9, 0.5]}},
    "handles": [{"name": "top", "region": {"box_mm": {"min": [-9, -9, 3.5], "max": [9, 9, 9]}},
                 "pose": {"rotation_vector_deg": [0, 0, 90], "pivot_mm": [1, 2, 4], "translation_mm": [0.5, -1, 2],
                          "scale": 1.25}}],
    "model": "gradient_field"})");
}

// GoodPlan() with the value at a JSON pointer set; missing keys are added.
inline nlohmann::json PlanWith(const std::string& pointer, const nlohmann::json& value) {
  nlohmann::json plan = GoodPlan();
  plan[nlohmann::json::json_pointer(pointer)] = value;
  return plan;
}

inline nlohmann::json PlanWithout(const std::string& key) {
  nlohmann::json plan = GoodPlan();
  plan.erase(key);
  return plan;
}

inline absl::StatusOr<Plan> Parse(const nlohmann::json& plan, const std::string& folder = "") {
  return ParsePlan(plan.dump(), folder, "plan.json");
}

}  // namespace tissueform::testing
