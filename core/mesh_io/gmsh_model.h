// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

#include "core/mesh_io/raw_mesh.h"

namespace tissueform {

// The tets of a file through Gmsh's library, which keeps one state for the whole process: call it
// in a child process (ReadIsolated), once. Internal to core/mesh_io/gmsh_reader.cc, which says what
// is kept.
//
// It lives in a module of its own (see module_symbol.h): Gmsh brings some ninety libraries.
//
// `path` must end with .msh or .mesh and hold no script: Gmsh runs what it does not know.
//
// Errors: InvalidArgument; FailedPrecondition when elements were lost because they repeat a number.
absl::StatusOr<RawMesh> ReadGmshModel(const std::string& path, bool is_medit);

// What the module exports, and by which name.
using GmshModelFunction = void (*)(const std::string& path, bool is_medit,
                                   absl::StatusOr<RawMesh>* mesh);
inline constexpr char kGmshModelSymbol[] = "TissueformReadGmshModel";
inline constexpr char kGmshModule[] = "libtissueform_gmsh.so";  // beside the program

}  // namespace tissueform
