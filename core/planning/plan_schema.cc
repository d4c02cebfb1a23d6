// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_schema.h"

#include <exception>

#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"
#include <valijson/adapters/nlohmann_json_adapter.hpp>
#include <valijson/schema.hpp>
#include <valijson/schema_parser.hpp>
#include <valijson/validation_results.hpp>
#include <valijson/validator.hpp>

#include "core/planning/plan_schema_text.h"
#include "core/planning/schema_errors.h"

namespace tissueform {
namespace {

using Json = nlohmann::json;
using Adapter = valijson::adapters::NlohmannJsonAdapter;

const valijson::Schema& CompiledSchema() {
  static const valijson::Schema* const compiled = [] {
    auto* schema = new valijson::Schema;
    valijson::SchemaParser().populateSchema(Adapter(PlanSchema()), *schema);
    return schema;
  }();
  return *compiled;
}

std::vector<SchemaViolation> ToViolations(const valijson::ValidationResults& results) {
  std::vector<SchemaViolation> violations;
  for (const valijson::ValidationResults::Error& error : results) {
    SchemaViolation violation{{}, error.description};
    // The first step is "<root>", the others are in square brackets.
    for (size_t i = 1; i < error.context.size(); ++i) {
      const std::string& step = error.context[i];
      violation.path.push_back(step.substr(1, step.size() - 2));
    }
    violations.push_back(std::move(violation));
  }
  return violations;
}

}  // namespace

const Json& PlanSchema() {
  static const Json* const schema = new Json(Json::parse(PlanSchemaText()));
  return *schema;
}

absl::Status CheckAgainstPlanSchema(const Json& plan) {
  try {
    valijson::ValidationResults results;
    valijson::Validator validator;
    if (validator.validate(CompiledSchema(), Adapter(plan), &results)) return absl::OkStatus();
    return absl::InvalidArgumentError(ExplainViolations(ToViolations(results), PlanSchema(), plan));
  } catch (const std::exception& exception) {
    return absl::InternalError(
        absl::StrCat("checking against the schema failed: ", exception.what()));
  }
}

}  // namespace tissueform
