// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/attribute.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace tissueform {

std::vector<double> ToDoubles(const Attribute& attribute) {
  return std::visit(
      [](const auto& values) { return std::vector<double>(values.begin(), values.end()); },
      attribute.values);
}

const Attribute* FindAttribute(const std::vector<Attribute>& attributes, const std::string& name) {
  for (const Attribute& attribute : attributes) {
    if (attribute.name == name) return &attribute;
  }
  return nullptr;
}

absl::StatusOr<std::vector<double>> FindScalars(const std::vector<Attribute>& attributes,
                                                const std::string& name, const std::string& kind) {
  const Attribute* attribute = FindAttribute(attributes, name);
  if (attribute == nullptr) {
    const auto name_of = [](std::string* out, const Attribute& a) { out->append(a.name); };
    const std::string names = absl::StrJoin(attributes, ", ", name_of);
    return absl::InvalidArgumentError(absl::StrCat("the mesh has no ", kind, " array \"", name,
                                                   "\"; it has ", names.empty() ? "none" : names));
  }
  if (attribute->components != 1) {
    return absl::InvalidArgumentError(absl::StrCat(
        kind, " array \"", name, "\" has ", attribute->components, " components; one is needed"));
  }
  return ToDoubles(*attribute);
}

}  // namespace tissueform
