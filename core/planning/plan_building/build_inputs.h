// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/planning/plan_building/plan_build_call.h"
#include "core/planning/plan_building/zip_inputs.h"

namespace tissueform {

// Paths of files that the JSON text of a recipe or of a surfaces file names, as it names them,
// sorted, each once. The label map of a recipe is not among them. The text has passed its schema.
//
// Errors: InvalidArgument for a path that another machine does not take (plan_build_service.proto:
// RecipeFile.path); the message gives the JSON pointer and not the path.
absl::StatusOr<std::vector<std::string>> NamedFiles(absl::string_view json);

// Writes into request.folder what another machine needs to build the same plan, and nothing that
// names the patient (BuildInputFiles in plan_build_call.h): of a CT its geometry and values alone,
// of a label map what BareLabelMap keeps. Files that the recipe names are copied as they are.
// Returns what is to be noted of the CT, one sentence each. Zips are unpacked by `zips`.
//
// Errors: those of ReadRecipe, ReadCtVolume, NamedFiles, MetaImageOf and WithoutText; NotFound for
// a file that the recipe names.
absl::StatusOr<std::vector<std::string>> WriteBuildInputs(const PlanBuildRequest& request,
                                                          ZipInputs* zips);

}  // namespace tissueform
