// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

#include "core/mesh/readers/raw_mesh.h"
#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// The mesh as an .obj, .off or .ply file, texts whose coordinates are written so that the same
// doubles are read again, or as a binary .stl file. By CGAL. Internal to core/mesh/io.
// `states_lps`: whether the header states SPACE=LPS.
//
// REQUIRES: one of these four formats.
absl::StatusOr<std::string> SurfaceFileContents(const TriangleMesh& mesh, MeshFormat format,
                                                bool states_lps);

}  // namespace tissueform
