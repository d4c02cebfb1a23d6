// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/mesh/attribute.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

// Limits on what is read from outside. docs/mesh-formats.md lists the defaults.
struct MeshReadLimits {
  int64_t max_file_bytes = int64_t{4} << 30;

  // For the mesh and what its reader needs beside it. A file that by its size or header needs more
  // is refused before it is tried, and a library that asks for more is stopped.
  int64_t max_memory_bytes = int64_t{16} << 30;

  // Processor time of a library that reads a file.
  int max_seconds = 600;
};

// A tet mesh as it lies in a file: the mesh and every numeric array with it.
struct TetMeshFile {
  TetMesh mesh;
  std::vector<Attribute> point_data;  // #V tuples each
  std::vector<Attribute> cell_data;   // #T tuples each
  // Tets whose corners were swapped on reading: none or all. Not written.
  Eigen::Index reoriented_tets = 0;
  // Points, lines and faces of the file, which are no part of the mesh. Not written.
  int64_t left_out_cells = 0;
};

// Reads linear tetrahedra from .vtu (VTK XML), .vtk (legacy VTK), .msh (Gmsh 1, 2.2, 4.1), .mesh
// (MEDIT) or .node and .ele (TetGen; either of the pair); the ending, in any case, chooses the
// format. docs/mesh-formats.md says what each keeps. When every tet is negative the file counts
// corners the other way round: they are reoriented (see RepairOrientation) and reported. All
// formats but .vtu are read by a helper program, because their libraries do not bear damaged files.
//
// Errors name the file: NotFound (no such file), PermissionDenied, InvalidArgument (truncated,
// another format behind the ending, a header that disagrees with its arrays, cells that are not
// tets, an array of the wrong length), ResourceExhausted (over a limit). Never throws.
absl::StatusOr<TetMeshFile> ReadTetMesh(const std::string& path, const MeshReadLimits& limits = {});

// The files that ReadTetMesh reads for `path`: it and, for TetGen's pairs, the other one.
std::vector<std::string> FilesOfTetMesh(const std::string& path);

// Writes a .vtu that is well-formed XML, its arrays appended in base64 and compressed by zlib,
// which VTK, ParaView and meshio open. Positions are written as doubles. The file carries
// kNotMedicalDeviceNotice as a comment and as the field "notice", an array of bytes.
//
// Writes beside `path` and renames at the end: when anything fails an old file stays as it was and
// no partial file is left.
absl::Status WriteTetMesh(const std::string& path, const TetMeshFile& file);

// Part of every exported result.
inline constexpr char kNotMedicalDeviceNotice[] =
    "Tissueform research software, not a medical device: not for diagnosis or treatment.";

}  // namespace tissueform
