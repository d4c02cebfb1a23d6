// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vtkAlgorithm.h>

#include "absl/status/statusor.h"

#include "core/mesh/readers/raw_mesh.h"

namespace tissueform {

// What one of VTK's readers of surfaces, which knows its file by now, makes of it: .vtp with all
// numeric arrays; .ply with normals, colours and texture coordinates; .stl, whose corners at
// exactly one place become one vertex. Polygons are split into triangles; strips, lines and points
// are an error. Internal to core/mesh/readers.
//
// Errors: InvalidArgument, without the name of the file. It may crash, throw, loop or print: call
// it in a helper program only.
absl::StatusOr<RawMesh> ReadVtkSurface(vtkAlgorithm* reader);

}  // namespace tissueform
