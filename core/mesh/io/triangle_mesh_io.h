// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/mesh/attribute.h"
#include "core/mesh/io/file_space.h"
#include "core/mesh/io/tet_mesh_io.h"
#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// A surface as it lies in a file: the triangles and every numeric array that the format has.
struct TriangleMeshFile {
  TriangleMesh mesh;
  std::vector<Attribute> point_data;  // #V tuples each
  std::vector<Attribute> cell_data;   // #F tuples each
  // Faces of the file with more than three corners, each split into a fan. Not written.
  int64_t split_polygons = 0;
  // What the file states; the mesh is in LPS by then. kLps is written, where the format has a
  // header for it.
  FileSpace space = FileSpace::kUnstated;
};

// Whether the ending of `path` is that of a surface format, in any case.
bool NamesSurface(const std::string& path);

// Reads .vtp (with all arrays), .ply (with normals, colours, texture coordinates), .stl (corners at
// exactly one place become one vertex), .obj or .off (places and faces); the ending, in any case,
// chooses the format. Each is read by a helper program. What states RAS coordinates (FileSpace) is
// turned to LPS.
//
// Errors: as ReadTetMesh (core/mesh/io/tet_mesh_io.h). Never throws.
absl::StatusOr<TriangleMeshFile> ReadTriangleMesh(const std::string& path,
                                                  const MeshReadLimits& limits = {});

// Writes the format that the ending names: .vtp (with all arrays), .ply .obj .off as text, or .stl
// in binary form, single precision; all but .vtp must have no arrays, because they would be lost
// (InvalidArgument). "Not a medical device" stands in the header of .stl, in a comment of the
// others. Coordinates come back exactly, except from .stl and, because VTK reads it in single
// precision, from .ply. All or nothing, as WriteTetMesh.
absl::Status WriteTriangleMesh(const std::string& path, const TriangleMeshFile& file);

}  // namespace tissueform
