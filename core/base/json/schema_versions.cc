// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/json/schema_versions.h"

#include <cstdint>

#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"

namespace tissueform {
namespace {

using Json = nlohmann::json;

void RemoveLater(Json* schema, int version);

// Of a list of alternatives, or of a map from names to subschemas.
void RemoveLaterMembers(Json* members, int version) {
  for (auto member = members->begin(); member != members->end();) {
    if (SinceVersion(*member) > version) {
      member = members->erase(member);
    } else {
      RemoveLater(&*member, version);
      ++member;
    }
  }
}

// Every keyword whose value is made of subschemas is walked through, known or not: values of other
// keywords (enum, default) hold none, and nothing in them is called since_version.
void RemoveLater(Json* schema, int version) {
  if (!schema->is_object()) return;
  for (auto& [keyword, value] : schema->items()) {
    if (value.is_array() || keyword == "properties" || keyword == "patternProperties" ||
        keyword == "definitions") {
      RemoveLaterMembers(&value, version);
    } else {
      RemoveLater(&value, version);
    }
  }
}

bool IsOfThisFormat(const Json& document, const Json& published) {
  const Json format = published.value(Json::json_pointer("/properties/format/const"), Json());
  return document.value("format", Json()) == format;
}

}  // namespace

int NewestVersion(const Json& published) {
  const Json versions = published.value(Json::json_pointer("/properties/version/enum"), Json{1});
  return versions.back().get<int>();
}

int SinceVersion(const Json& subschema) {
  return subschema.is_object() ? subschema.value("since_version", 1) : 1;
}

Json SchemaOfVersion(const Json& published, int version) {
  Json schema = published;
  RemoveLater(&schema, version);
  return schema;
}

absl::StatusOr<int> VersionToCheck(const Json& document, const Json& published) {
  const int newest = NewestVersion(published);
  if (!document.is_object() || !document.contains("version")) return newest;
  const Json& version = document.at("version");
  if (!version.is_number_unsigned() || version == 0) return newest;
  const auto number = version.get<uint64_t>();
  if (number <= static_cast<uint64_t>(newest)) return static_cast<int>(number);
  if (!IsOfThisFormat(document, published)) return newest;
  return absl::InvalidArgumentError(
      absl::StrCat("wrong value at /version: ", number, " must be ", newest == 1 ? "" : "1 to ",
                   newest, "; it was made for a newer program, so update this one"));
}

}  // namespace tissueform
