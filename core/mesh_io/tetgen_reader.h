// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/statusor.h"

#include "core/mesh_io/mesh_format.h"
#include "core/mesh_io/mesh_read_limits.h"
#include "core/mesh_io/raw_mesh.h"

namespace tissueform {

// A pair of TetGen files, .node and .ele, counted from 0 or 1, read by TetGen's own tetgenio.
// Point attributes become "tetgen_attribute_1", ..., boundary markers "tetgen_marker"; a tet's only
// attribute becomes "tetgen_region", several "tetgen_attribute_1", .... Internal to core/mesh_io.
//
// Errors: InvalidArgument, ResourceExhausted, without the name of the file.
absl::StatusOr<RawMesh> ReadTetgen(const CheckedMeshFile& file, const MeshReadLimits& limits);

}  // namespace tissueform
