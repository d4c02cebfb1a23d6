// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "core/imaging/ct/ct_volume.h"
#include "core/planning/plan_building/recipe.h"
#include "core/planning/plan_building/surface_head.h"

namespace tissueform {

// What a surfaces file (docs/bring-your-own.md, docs/surfaces.schema.json) leads to.
struct SurfacesInput {
  HeadSurfaces surfaces;  // LPS, mm
  Recipe recipe;          // what the file says besides, as a recipe
  // Format "surfaces"; the digest is that of the surfaces file and of all files that it names. The
  // notes state which units and axes were given and which were assumed.
  CtProvenance provenance;
  std::vector<std::string> roles;  // "skin", "skull", "lower jaw", ... of the files
};

// The JSON schema of the format.
const char* SurfacesSchemaText();

// Reads a surfaces file and all surfaces that it names.
//
// Errors: InvalidArgument when the file does not follow the schema or a surface cannot be used (it
// is named by its role); those of ReadRecipe, ReadTriangleMesh and WrapSurface.
absl::StatusOr<SurfacesInput> ReadSurfaces(const std::string& path, int threads);

}  // namespace tissueform
