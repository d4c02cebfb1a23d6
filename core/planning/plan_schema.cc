// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_schema.h"

#include "core/base/json/json_schema.h"

namespace tissueform {
namespace {

const JsonSchema& Schema() {
  static const JsonSchema* const schema = new JsonSchema(PlanSchemaText());
  return *schema;
}

}  // namespace

const nlohmann::json& PlanSchema() { return Schema().json(); }

absl::Status CheckAgainstPlanSchema(const nlohmann::json& plan) { return Schema().Check(plan); }

int LowestPlanVersion(const nlohmann::json& plan) { return Schema().LowestVersion(plan); }

}  // namespace tissueform
