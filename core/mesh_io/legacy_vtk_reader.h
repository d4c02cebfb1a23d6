// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/statusor.h"

#include "core/mesh_io/mesh_format.h"
#include "core/mesh_io/mesh_read_limits.h"
#include "core/mesh_io/raw_mesh.h"

namespace tissueform {

// A legacy VTK file (.vtk), ASCII or binary, that holds an unstructured grid of linear tets; every
// numeric array is kept. Internal to core/mesh_io.
//
// Errors: InvalidArgument, ResourceExhausted, without the name of the file.
absl::StatusOr<RawMesh> ReadLegacyVtk(const CheckedMeshFile& file, const MeshReadLimits& limits);

}  // namespace tissueform
