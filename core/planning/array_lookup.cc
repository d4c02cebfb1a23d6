// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/array_lookup.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

#include "core/mesh_io/tet_mesh_io.h"

namespace tissueform {

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
