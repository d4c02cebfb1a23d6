// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/json/json_schema.h"

#include <exception>
#include <vector>

#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"
#include <valijson/adapters/nlohmann_json_adapter.hpp>
#include <valijson/schema.hpp>
#include <valijson/schema_parser.hpp>
#include <valijson/validation_results.hpp>
#include <valijson/validator.hpp>

#include "core/json/schema_errors.h"

namespace tissueform {
namespace {

using Json = nlohmann::json;
using Adapter = valijson::adapters::NlohmannJsonAdapter;

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

struct JsonSchema::Compiled {
  explicit Compiled(const char* text) : json(Json::parse(text)) {
    valijson::SchemaParser().populateSchema(Adapter(json), schema);
  }

  const Json json;
  valijson::Schema schema;
};

JsonSchema::JsonSchema(const char* text) : compiled_(std::make_unique<const Compiled>(text)) {}

JsonSchema::~JsonSchema() = default;

const Json& JsonSchema::json() const { return compiled_->json; }

absl::Status JsonSchema::Check(const Json& document) const {
  try {
    valijson::ValidationResults results;
    valijson::Validator validator;
    if (validator.validate(compiled_->schema, Adapter(document), &results)) {
      return absl::OkStatus();
    }
    return absl::InvalidArgumentError(ExplainViolations(ToViolations(results), json(), document));
  } catch (const std::exception& exception) {
    return absl::InternalError(
        absl::StrCat("checking against the schema failed: ", exception.what()));
  }
}

}  // namespace tissueform
