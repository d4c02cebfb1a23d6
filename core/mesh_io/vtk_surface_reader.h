// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/statusor.h"

#include "core/mesh_io/mesh_format.h"
#include "core/mesh_io/mesh_read_limits.h"
#include "core/mesh_io/raw_mesh.h"

namespace tissueform {

// .vtp with all numeric arrays; .ply with normals, colours and texture coordinates; .stl, whose
// corners at exactly one place become one vertex. Polygons are split into triangles; strips, lines
// and points are an error. Internal to core/mesh_io.
//
// REQUIRES: one of these three formats.
// Errors: InvalidArgument, ResourceExhausted, without the name of the file.
absl::StatusOr<RawMesh> ReadVtkSurface(const CheckedMeshFile& file, const MeshReadLimits& limits);

}  // namespace tissueform
