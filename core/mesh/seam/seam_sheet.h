// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "absl/status/statusor.h"
#include <Eigen/Core>

#include "core/mesh/tet_mesh.h"

namespace tissueform {

// A sheet within a mesh along which it is to part. It is a piece of the surface where a height is
// zero; both functions are pure.
struct SeamSheet {
  // Continuous; negative below the surface, positive above. Its size does not matter.
  std::function<double(const Eigen::Vector3d& place_mm)> height;
  // Whether a place on the surface belongs to the sheet.
  std::function<bool(const Eigen::Vector3d& place_mm)> holds;
};

// A mesh with facets in the sheet: no edge crosses it.
struct SeamedMesh {
  TetMesh mesh;
  Eigen::Index boundary_vertices = 0;  // which come first
  std::vector<int8_t> side;            // #V: -1 below, 0 on the sheet, 1 above
  int64_t num_moved = 0;               // vertices that were moved onto the sheet
  int64_t num_added = 0;               // vertices that were added on edges through it
};

// Moves vertices onto the sheet where it crosses one of their edges near them, the boundary's along
// edges of the boundary only, and splits the other edges that cross it. The mesh's first
// `boundary_vertices` are those on its boundary, which keep their numbers; those that are added on
// the boundary follow, then come the others.
//
// Errors: InvalidArgument when the sheet crosses no edge.
absl::StatusOr<SeamedMesh> ConformToSheet(const TetMesh& mesh, Eigen::Index boundary_vertices,
                                          const SeamSheet& sheet);

// A mesh that has been parted. The doubles come last, each at the place of its original.
struct PartedMesh {
  TetMesh mesh;
  std::vector<int32_t> original_of_double;  // of vertex #V - #doubles + k the one above the sheet
  TriangleIndices wall;  // the sheet, of vertices above it, facing up: away from what lies below
};

// Parts a mesh along the facets between what lies above and below its sheet. A vertex is doubled
// where they separate the tets about it; those on the rim of the sheet within the mesh are not, nor
// are those that `stays_joined` names (#V, or empty: none).
//
// REQUIRES: one side a vertex. Errors: InvalidArgument when nothing is parted.
absl::StatusOr<PartedMesh> PartMesh(const TetMesh& mesh, const std::vector<int8_t>& side,
                                    const std::vector<bool>& stays_joined = {});

}  // namespace tissueform
