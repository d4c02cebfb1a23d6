// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

#include "core/mesh/readers/raw_mesh.h"

namespace tissueform {

// The tets of a file through Gmsh's library, which keeps one state for the whole process: call it
// in a helper program, once. core/mesh/io/gmsh_reader.h says what is kept.
//
// `path` must end with .msh or .mesh and hold no script: Gmsh runs what it does not know.
//
// Errors: InvalidArgument; AlreadyExists, which nothing else on the way of a helper's answer says,
// when elements were lost because they repeat a number.
absl::StatusOr<RawMesh> ReadGmshModel(const std::string& path, bool is_medit);

}  // namespace tissueform
