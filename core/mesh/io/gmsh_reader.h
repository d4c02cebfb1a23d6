// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/statusor.h"

#include "core/base/process/helper_program.h"
#include "core/mesh/readers/raw_mesh.h"

namespace tissueform {

// Gmsh's .msh (1, 2.2, 4.1, ASCII or binary) and MEDIT's .mesh, both through Gmsh's library in a
// helper program.
//
// Tets come in the order of their numbers, which is that of the file in practice; vertices in the
// order of theirs, without those that no tet uses. Kept as cell data: of .msh "gmsh_entity",
// "gmsh_physical" (the lowest physical group of the tet's volume, 0 where it has none; left out
// when none has one) and every $ElementData under its name; of .mesh "medit_reference". $NodeData
// becomes point data. Values that a file does not give are NaN. Other cells with volume than linear
// tets are an error; points, lines and triangles are left out. Internal to core/mesh/io.
//
// REQUIRES: one of these two formats.
// Errors: InvalidArgument, ResourceExhausted, without the name of the file.
absl::StatusOr<RawMesh> ReadGmsh(const CheckedMeshFile& file, const IsolationLimits& limits);

}  // namespace tissueform
