// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/json/json_schema.h"

#include <exception>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"
#include <valijson/adapters/nlohmann_json_adapter.hpp>
#include <valijson/schema.hpp>
#include <valijson/schema_parser.hpp>
#include <valijson/validation_results.hpp>
#include <valijson/validator.hpp>

#include "core/base/json/schema_errors.h"
#include "core/base/json/schema_versions.h"
#include "core/base/status_macros.h"

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

// The schema of one version.
class OneVersion {
 public:
  explicit OneVersion(Json json) : json_(std::move(json)) {
    valijson::SchemaParser().populateSchema(Adapter(json_), schema_);
  }

  // Nothing when the document follows it.
  std::vector<SchemaViolation> Violations(const Json& document) const {
    valijson::ValidationResults results;
    valijson::Validator validator;
    if (validator.validate(schema_, Adapter(document), &results)) return {};
    return ToViolations(results);
  }
  const Json& json() const { return json_; }

 private:
  const Json json_;
  valijson::Schema schema_;
};

Json WithVersion(Json document, int version) {
  document["version"] = version;
  return document;
}

}  // namespace

struct JsonSchema::Compiled {
  explicit Compiled(const char* text) : published(Json::parse(text)) {
    for (int version = 1; version <= NewestVersion(published); ++version) {
      versions.push_back(std::make_unique<const OneVersion>(SchemaOfVersion(published, version)));
    }
  }

  int newest() const { return static_cast<int>(versions.size()); }
  const OneVersion& Of(int version) const { return *versions[static_cast<size_t>(version) - 1]; }

  // The lowest version from `first` on whose schema the document follows, apart from the version
  // that it states; 0 if no version fits.
  int LowestThatFits(const Json& document, int first) const {
    for (int version = first; document.is_object() && version <= newest(); ++version) {
      if (Of(version).Violations(WithVersion(document, version)).empty()) return version;
    }
    return 0;
  }

  absl::Status Check(const Json& document) const {
    TF_ASSIGN_OR_RETURN(const int version, VersionToCheck(document, published));
    const OneVersion& schema = Of(version);
    const std::vector<SchemaViolation> violations = schema.Violations(document);
    if (violations.empty()) return absl::OkStatus();
    std::string message = ExplainViolations(violations, schema.json(), published, document);
    if (const int fits = LowestThatFits(document, version + 1); fits != 0) {
      absl::StrAppend(&message, " (as \"version\": ", fits, " it would be read)");
    }
    return absl::InvalidArgumentError(message);
  }

  const Json published;
  std::vector<std::unique_ptr<const OneVersion>> versions;
};

JsonSchema::JsonSchema(const char* text) : compiled_(std::make_unique<const Compiled>(text)) {}

JsonSchema::~JsonSchema() = default;

const Json& JsonSchema::json() const { return compiled_->published; }

absl::Status JsonSchema::Check(const Json& document) const {
  try {
    return compiled_->Check(document);
  } catch (const std::exception& exception) {
    return absl::InternalError(
        absl::StrCat("checking against the schema failed: ", exception.what()));
  }
}

int JsonSchema::LowestVersion(const Json& document) const {
  const int fits = compiled_->LowestThatFits(document, 1);
  return fits == 0 ? compiled_->newest() : fits;
}

}  // namespace tissueform
