// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "absl/status/statusor.h"

#include "core/base/types.h"
#include "core/mechanics/constraints/constraint_set.h"
#include "core/mesh/tet_mesh.h"
#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// The boundary of a tet mesh as a mesh of its own.
struct BoundarySurface {
  TriangleMesh mesh;
  std::vector<int32_t> vertices;  // of the tet mesh, for every vertex of `mesh`

  // Rows of `of_tet_mesh` that belong to the boundary.
  Positions Pick(const Positions& of_tet_mesh) const { return of_tet_mesh(vertices, Eigen::all); }
};
BoundarySurface BoundaryOf(const TetMesh& mesh);

// Rows of `positions` for which `inside` holds, rising.
std::vector<int32_t> VerticesWhere(const Positions& positions,
                                   const std::function<bool(const Eigen::Vector3d&)>& inside);

// The lowest vertices of a bar along z fixed, the highest ones the one handle, "end"; for a volume
// mesh and for its boundary surface.
absl::StatusOr<ConstraintSet> ConstrainEnds(const Positions& positions);

}  // namespace tissueform
