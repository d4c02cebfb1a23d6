// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/statusor.h"

#include "core/mesh/io/tet_mesh_io.h"
#include "core/mesh/readers/raw_mesh.h"

namespace tissueform {

// Reads a file of any format but .vtu in a helper program (core/mesh/readers): file libraries
// crash, loop, print and end the program on damaged files, and Gmsh knows one state for the whole
// process. The helper is bound to the limits (memory beyond what it begins with, processor time)
// and cannot put a byte into a file. Any thread may call it. Internal to core/mesh/io.
//
// Errors, without the name of the file: those of CallMeshReader.
absl::StatusOr<RawMesh> ReadIsolated(const CheckedMeshFile& file, const MeshReadLimits& limits);

}  // namespace tissueform
