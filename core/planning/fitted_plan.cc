// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/fitted_plan.h"

#include "nlohmann/json.hpp"

#include "core/base/json/json_text.h"
#include "core/base/status_macros.h"
#include "core/planning/json_values.h"
#include "core/planning/plan_schema.h"

namespace tissueform {

using Json = nlohmann::json;

absl::StatusOr<std::string> PlanWithPoses(std::string_view plan, const std::string& mesh,
                                          absl::Span<const HandlePose> poses,
                                          const std::vector<bool>& changed) {
  TF_ASSIGN_OR_RETURN(Json json, ParseJsonStrictly(std::string(plan)));
  json["mesh"] = mesh;
  // What a planner wrote into the plan is of its old poses.
  for (const auto& [key, schema] : PlanSchema().at("properties").items()) {
    if (schema.value("from_planner", false)) json.erase(key);
  }
  for (size_t h = 0; h < poses.size(); ++h) {
    if (changed[h]) json["handles"][h]["pose"] = ToJson(poses[h]);
  }
  json["version"] = LowestPlanVersion(json);
  TF_RETURN_IF_ERROR(CheckAgainstPlanSchema(json));
  return json.dump(2) + "\n";
}

}  // namespace tissueform
