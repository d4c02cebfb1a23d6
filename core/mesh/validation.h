// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string_view>
#include <vector>

#include "absl/status/status.h"

#include "core/base/types.h"
#include "core/mesh/mesh_defect.h"
#include "core/mesh/tet_mesh.h"
#include "core/mesh/tet_quality.h"

namespace tissueform {

// What ValidateTetMesh found. Kinds, and what they count:
//   non_finite_vertices    error    vertices with NaN or infinite coordinates
//   degenerate_tets        error    tets with a repeated vertex or |volume| <= 1e-12 * longest^3,
//                                   with the longest edge
//   inverted_tets          error    tets with negative volume
//   duplicate_tets         error    tets with the same four vertices as an earlier one
//   overshared_facets      error    facets that three or more tets share
//   reoriented_tets        warning  tets whose corners were swapped on reading
//   left_out_cells         warning  points, lines and faces of the file beside its tets
//   duplicate_vertices     warning  vertices at exactly the place of an earlier one
//   non_matching_facets    warning  boundary facets that lie exactly on another one without sharing
//                                   its vertices: parts that touch and are not joined
//   unreferenced_vertices  warning  vertices that no tet holds; they stay where they are
//   non_manifold_edges     warning  boundary edges with other than two boundary facets
//   several_components     warning  more than one connected component
struct MeshReport {
  Eigen::Index num_vertices = 0;
  Eigen::Index num_tets = 0;
  Eigen::Index num_boundary_facets = 0;
  Eigen::Index num_boundary_vertices = 0;
  int32_t num_components = 0;
  Eigen::Index num_edges = 0;
  // Edges whose cotangent weight (CountNegativeCotangentWeights) is negative: no defect, but with
  // them harmonic fields may leave [0, 1]. 0 when a coordinate is not finite.
  Eigen::Index num_negative_cotangent_weights = 0;
  TetQualitySummary quality;  // all zero when a coordinate is not finite
  std::vector<MeshDefect> defects;

  bool usable() const { return AreUsable(defects); }
  const MeshDefect* Find(std::string_view kind) const { return FindDefect(defects, kind); }
};

// `reoriented_tets` and `left_out_cells` are what reading has counted (TetMeshFile); they are only
// reported.
MeshReport ValidateTetMesh(const TetMesh& mesh, Eigen::Index reoriented_tets = 0,
                           Eigen::Index left_out_cells = 0);

// OK when the report is usable, otherwise InvalidArgument with the first error's explanation and
// the number of further ones.
absl::Status CheckUsable(const MeshReport& report);

// The same as CheckUsable(ValidateTetMesh(mesh)) without what the report states beside errors, in
// less than half the time.
absl::Status CheckTetMesh(const TetMesh& mesh);

}  // namespace tissueform
