// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>

#include "absl/status/statusor.h"

#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// About so many triangles of the same shape, for drawing: edges are collapsed where that changes
// the volume and the surface least (Lindstrom and Turk 1998, by CGAL), so that many remain where it
// is bent, and never so that a triangle turns over. Coarser than that no triangle is left out.
// Vertices are
// new, those without a triangle gone. A surface with fewer triangles stays as it is. Deterministic.
//
// Errors: InvalidArgument when triangles cannot be joined to a surface with two sides.
absl::StatusOr<TriangleMesh> DecimateSurface(const TriangleMesh& surface, int64_t triangles);

}  // namespace tissueform
