// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/mesh/io/tet_mesh_io.h"
#include "core/mesh/readers/raw_mesh.h"

namespace tissueform {

enum class MeshKind { kTets, kTriangles };

// The surface format that the ending of `path` names; InvalidArgument for any other ending.
absl::StatusOr<MeshFormat> SurfaceFormatOfPath(const std::string& path);

// Finds the format by the ending, in any case (VTK's two formats for tets by content), and checks
// what can be checked without a library: the file is there, is a file, is within the limits, begins
// as its format does and, where the format has an end mark, ends with it. For TetGen's pairs `path`
// may name either file.
//
// Errors: NotFound, PermissionDenied, ResourceExhausted (over a limit), InvalidArgument (another
// kind of mesh, another format behind the ending, truncated). Messages name the file.
absl::StatusOr<CheckedMeshFile> CheckMeshFile(const std::string& path, MeshKind kind,
                                              const MeshReadLimits& limits);

// The other file of a TetGen pair: "a.node" for "a.ele" and the reverse, in its case.
std::string TetgenPartner(const std::string& path);

// "cannot read mesh PATH: why", InvalidArgument.
absl::Status CannotReadMesh(const std::string& path, absl::string_view why);

}  // namespace tissueform
