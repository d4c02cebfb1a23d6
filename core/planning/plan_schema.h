// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/status.h"
#include "nlohmann/json_fwd.hpp"

namespace tissueform {

// The text of docs/plan.schema.json.
const char* PlanSchemaText();

// The published schema of plans, docs/plan.schema.json, as it was when the program was built: that
// of the newest version (core/base/json/schema_versions.h).
const nlohmann::json& PlanSchema();

// InvalidArgument in one line when `plan` does not follow the schema of the version that it says:
// what is wrong, at which JSON pointer, and what is allowed there.
absl::Status CheckAgainstPlanSchema(const nlohmann::json& plan);

// What a plan with these keys is to say as its "version".
int LowestPlanVersion(const nlohmann::json& plan);

}  // namespace tissueform
