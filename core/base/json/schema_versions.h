// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/statusor.h"
#include "nlohmann/json_fwd.hpp"

namespace tissueform {

// How a format grows (docs/plan-format.md, "Versions"): a version only adds, and what it adds may
// be left out. So one schema is published, that of the newest version, and those of the others
// follow from it: everything that a version added carries "since_version": N in its subschema, and
// /properties/version/enum lists the versions, 1 to the newest.
//
// May carry it: a property that is not required, and an alternative of anyOf or oneOf.

// Without /properties/version/enum there is one version.
int NewestVersion(const nlohmann::json& published);

// The version that a subschema came with; 1 unless it says so.
int SinceVersion(const nlohmann::json& subschema);

// The schema of that version: without what came later.
nlohmann::json SchemaOfVersion(const nlohmann::json& published, int version);

// By which version a document is to be checked: by the one that it says. One that says none, or
// nothing that is a version, is left to the newest schema, which reports what is wrong with it.
//
// Errors: InvalidArgument for a document of this format and a version above the newest.
absl::StatusOr<int> VersionToCheck(const nlohmann::json& document, const nlohmann::json& published);

}  // namespace tissueform
