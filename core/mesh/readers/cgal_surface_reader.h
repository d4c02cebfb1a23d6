// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/statusor.h"

#include "core/mesh/readers/raw_mesh.h"

namespace tissueform {

// .obj and .off: places and faces. VTK's OBJ reader gives every face its own copy of a vertex where
// a file has normals or textures, which tears the surface apart; CGAL's keeps the file's vertices.
// Polygons are split into triangles. Internal to core/mesh/readers.
//
// REQUIRES: one of these two formats.
// Errors: InvalidArgument, without the name of the file. It may crash, throw, loop or print: call
// it in a helper program only.
absl::StatusOr<RawMesh> ReadCgalSurface(const CheckedMeshFile& file);

}  // namespace tissueform
