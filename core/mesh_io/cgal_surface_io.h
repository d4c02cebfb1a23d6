// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

#include "core/mesh/triangle_mesh.h"
#include "core/mesh_io/mesh_format.h"
#include "core/mesh_io/mesh_read_limits.h"
#include "core/mesh_io/raw_mesh.h"

namespace tissueform {

// .obj and .off: places and faces. VTK's OBJ reader gives a vertex anew to every face where a file
// has normals or textures, which tears the surface apart; CGAL's keeps the vertices of the file.
// Polygons are split into triangles. Internal to core/mesh_io.
//
// REQUIRES: one of these two formats.
// Errors: InvalidArgument, ResourceExhausted, without the name of the file.
absl::StatusOr<RawMesh> ReadCgalSurface(const CheckedMeshFile& file, const MeshReadLimits& limits);

// The mesh as an .obj, .off or .ply file, texts whose coordinates are written so that the same
// doubles are read again, or as a binary .stl file.
//
// REQUIRES: one of these four formats.
absl::StatusOr<std::string> SurfaceFileContents(const TriangleMesh& mesh, MeshFormat format);

}  // namespace tissueform
