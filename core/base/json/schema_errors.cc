// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/json/schema_errors.h"

#include <algorithm>
#include <array>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "nlohmann/json.hpp"

#include "core/base/json/json_text.h"
#include "core/base/json/schema_versions.h"

namespace tissueform {
namespace {

using Json = nlohmann::json;

enum class Kind { kUnknownKey, kType, kOneOf, kMissingKey, kValue, kOther, kEcho };

struct Wording {
  absl::string_view start;  // of the description that the library writes
  Kind kind;
};
constexpr std::array<Wording, 11> kWordings = {{
    {"Object contains a property that could not be validated", Kind::kUnknownKey},
    {"Value type not permitted", Kind::kType},
    {"Failed to validate against any child schemas", Kind::kOneOf},
    {"Failed to validate against exactly one child", Kind::kOneOf},
    {"Missing required property", Kind::kMissingKey},
    {"Failed to match against any enum", Kind::kValue},
    {"Failed to match expected value", Kind::kValue},
    {"Failed to validate against schema associated", Kind::kEcho},
    {"Failed to validate item", Kind::kEcho},
    {"Failed to validate against child schema", Kind::kEcho},
    {"Failed to validate against additional properties", Kind::kEcho},
}};

Kind KindOf(const SchemaViolation& violation) {
  for (const Wording& wording : kWordings) {
    if (absl::StartsWith(violation.description, wording.start)) return wording.kind;
  }
  return Kind::kOther;
}

const SchemaViolation& NearestToMistake(const std::vector<SchemaViolation>& violations) {
  const auto better = [](const SchemaViolation& a, const SchemaViolation& b) {
    const Kind kind_a = KindOf(a);
    const Kind kind_b = KindOf(b);
    if ((kind_a == Kind::kEcho) != (kind_b == Kind::kEcho)) return kind_b == Kind::kEcho;
    if (a.path.size() != b.path.size()) return a.path.size() > b.path.size();
    return kind_a < kind_b;
  };
  return *std::min_element(violations.begin(), violations.end(), better);
}

const Json& FollowReference(const Json& subschema, const Json& schema) {
  const auto reference = subschema.find("$ref");
  if (reference == subschema.end()) return subschema;
  return schema.at(Json::json_pointer(reference->get<std::string>().substr(1)));
}

// The part of the schema that speaks of `path`; an empty object where no part does.
const Json& SubschemaAt(const std::vector<std::string>& path, const Json& schema) {
  static const Json nothing = Json::object();
  const Json* at = &schema;
  for (const std::string& step : path) {
    if (at->contains("properties") && at->at("properties").contains(step)) {
      at = &FollowReference(at->at("properties").at(step), schema);
    } else if (at->contains("patternProperties")) {
      at = &FollowReference(*at->at("patternProperties").begin(), schema);
    } else if (at->contains("items")) {
      at = &FollowReference(at->at("items"), schema);
    } else {
      return nothing;
    }
  }
  return *at;
}

// The value at `path` in one line and not longer than a message bears.
std::string ShortValueAt(const std::vector<std::string>& path, const Json& document) {
  const Json* at = &document;
  for (const std::string& step : path) {
    at = at->is_array() ? &at->at(std::stoul(step)) : &at->at(step);
  }
  constexpr size_t kMaxLength = 60;
  std::string text = at->dump(-1, ' ', false, Json::error_handler_t::replace);
  if (text.size() > kMaxLength) text = text.substr(0, kMaxLength) + "...";
  return text;
}

// What stands between the first and the last single quote.
std::string Quoted(const std::string& description) {
  const size_t first = description.find(
      '\'', description.rfind(": '") == std::string::npos ? 0 : description.rfind(": '"));
  const size_t last = description.rfind('\'');
  return first < last ? description.substr(first + 1, last - first - 1) : "";
}

std::string AllowedKeys(const Json& subschema) {
  if (!subschema.contains("properties")) return "keys there are whole numbers";
  std::vector<std::string> keys;
  for (const auto& [key, unused] : subschema.at("properties").items()) keys.push_back(key);
  return absl::StrCat("allowed there: ", absl::StrJoin(keys, ", "));
}

std::string UnknownKey(const std::string& key, const std::string& pointer, const Json& subschema,
                       const Json& newest) {
  if (newest.contains("properties") && newest.at("properties").contains(key)) {
    return absl::StrCat("key \"", key, "\" at ", pointer, " came with version ",
                        SinceVersion(newest.at("properties").at(key)),
                        " of the format; write that as \"version\", or remove the key");
  }
  return absl::StrCat("unknown key \"", key, "\" at ", pointer, "; ", AllowedKeys(subschema));
}

std::string TypeName(const Json& subschema) {
  const std::string type = subschema.value("type", "value of another type");
  if (type == "integer") return "a whole number without decimal point";
  return absl::StrCat(type == "array" || type == "object" ? "an " : "a ", type);
}

// A type with its bounds, where it has both.
std::string TypeAndRange(const Json& subschema) {
  if (!subschema.contains("minimum") || !subschema.contains("maximum")) return TypeName(subschema);
  return absl::StrCat(TypeName(subschema), " from ", subschema.at("minimum").dump(), " to ",
                      subschema.at("maximum").dump());
}

std::string AllowedValues(const Json& subschema) {
  if (subschema.contains("const")) return subschema.at("const").dump();
  std::vector<std::string> values;
  for (const Json& value : subschema.value("enum", Json::array())) values.push_back(value.dump());
  for (const Json& form : subschema.value("anyOf", Json::array())) {
    values.push_back(form.contains("enum") ? AllowedValues(form) : TypeAndRange(form));
  }
  return absl::StrJoin(values, " or ");
}

std::string Meaning(const Json& subschema) {
  const std::string description = subschema.value("description", "");
  return description.empty() ? "" : absl::StrCat(" (", description, ")");
}

std::string Explain(const std::vector<SchemaViolation>& violations, const Json& schema,
                    const Json& newest, const Json& document) {
  const SchemaViolation& violation = NearestToMistake(violations);
  const std::string pointer = JsonPointer(violation.path);
  const Json& subschema = SubschemaAt(violation.path, schema);
  const std::string value = ShortValueAt(violation.path, document);
  switch (KindOf(violation)) {
    case Kind::kUnknownKey:
      return UnknownKey(Quoted(violation.description), pointer, subschema,
                        SubschemaAt(violation.path, newest));
    case Kind::kMissingKey:
      return absl::StrCat("missing key \"", Quoted(violation.description), "\" at ", pointer,
                          "; add it");
    case Kind::kType:
      return absl::StrCat("wrong type at ", pointer, ": ", value, " must be ", TypeName(subschema),
                          Meaning(subschema));
    case Kind::kValue:
      return absl::StrCat("wrong value at ", pointer, ": ", value, " must be ",
                          AllowedValues(subschema), Meaning(subschema));
    case Kind::kOneOf:
      return absl::StrCat("wrong combination of keys at ", pointer, ": write one of the forms",
                          Meaning(subschema));
    case Kind::kOther:
    case Kind::kEcho:
      break;
  }
  std::string description = violation.description;
  if (!description.empty())
    description[0] = absl::ascii_tolower(static_cast<unsigned char>(description[0]));
  return absl::StrCat("wrong value at ", pointer, ": ", value, ", ", description,
                      Meaning(subschema));
}

// A key may hold any characters: line breaks, and control sequences of a terminal.
std::string OnOneLine(const std::string& text) {
  std::string line;
  for (const char c : text) {
    if (absl::ascii_iscntrl(static_cast<unsigned char>(c))) {
      absl::StrAppend(&line, "\\x", absl::Hex(static_cast<unsigned char>(c), absl::kZeroPad2));
    } else {
      line += c;
    }
  }
  return line;
}

}  // namespace

std::string ExplainViolations(const std::vector<SchemaViolation>& violations, const Json& schema,
                              const Json& newest, const Json& document) {
  return OnOneLine(Explain(violations, schema, newest, document));
}

}  // namespace tissueform
