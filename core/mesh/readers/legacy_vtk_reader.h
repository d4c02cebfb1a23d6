// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/statusor.h"

#include "core/mesh/readers/raw_mesh.h"

namespace tissueform {

// A legacy VTK file (.vtk), ASCII or binary, that holds an unstructured grid of linear tets; every
// numeric array is kept. Internal to core/mesh/readers.
//
// Errors: InvalidArgument, without the name of the file. It may crash, throw, loop or print: call
// it in a helper program only.
absl::StatusOr<RawMesh> ReadLegacyVtk(const CheckedMeshFile& file);

}  // namespace tissueform
