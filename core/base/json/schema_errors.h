// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "nlohmann/json_fwd.hpp"

namespace tissueform {

// One result of the schema library: where, and in its own words.
struct SchemaViolation {
  std::vector<std::string> path;  // keys and array positions from the root
  std::string description;
};

// One line about the violation that is nearest to the mistake. The library reports a mistake again
// at every level above it and for every alternative that it does not fit; those echoes are left
// out. The allowed values come from `schema`, the one of the document's version; for a key that
// only `newest` knows, the line names the version that introduced it.
//
// REQUIRES: at least one violation.
std::string ExplainViolations(const std::vector<SchemaViolation>& violations,
                              const nlohmann::json& schema, const nlohmann::json& newest,
                              const nlohmann::json& document);

}  // namespace tissueform
