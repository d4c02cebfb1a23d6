// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/statusor.h"

#include "core/mesh_io/mesh_format.h"
#include "core/mesh_io/mesh_read_limits.h"
#include "core/mesh_io/raw_mesh.h"

namespace tissueform {

// A VTK XML unstructured grid of linear tets, ASCII, binary or appended, compressed or not. Runs in
// this process: TetGridReader checks what VTK does not. Internal to core/mesh_io.
//
// Errors, without the name of the file: InvalidArgument; ResourceExhausted when the counts of the
// header need more memory than the limit. Never throws.
absl::StatusOr<RawMesh> ReadVtu(const CheckedMeshFile& file, const MeshReadLimits& limits);

}  // namespace tissueform
