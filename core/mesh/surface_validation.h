// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string_view>
#include <vector>

#include "core/mesh/mesh_defect.h"
#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// What ValidateTriangleMesh found. Kinds, and what they count:
//   non_finite_vertices    error    vertices with NaN or infinite coordinates
//   degenerate_triangles   error    triangles with a repeated vertex or area <= 1e-12 * longest^2,
//                                   with the longest edge
//   split_polygons         warning  faces of the file with more than three corners
//   open_edges             warning  edges of one triangle: the surface has a border
//   non_manifold_edges     warning  edges of three or more triangles
//   turned_triangles       warning  edges that both their triangles run through the same way: one
//                                   of them faces the other side
//   duplicate_vertices     warning  vertices at exactly the place of an earlier one
//   unreferenced_vertices  warning  vertices that no triangle holds
//   several_components     warning  more than one connected component
struct SurfaceReport {
  Eigen::Index num_vertices = 0;
  Eigen::Index num_triangles = 0;
  Eigen::Index num_edges = 0;
  int32_t num_components = 0;
  // V - E + F, counting the vertices that triangles hold: 2 for a sphere.
  Eigen::Index euler_characteristic = 0;
  double area_mm2 = 0;             // 0 when a coordinate is not finite
  double enclosed_volume_mm3 = 0;  // 0 unless closed; negative when the surface faces inwards
  std::vector<MeshDefect> defects;

  bool usable() const { return AreUsable(defects); }
  const MeshDefect* Find(std::string_view kind) const { return FindDefect(defects, kind); }
  // Every edge has two triangles that face the same side, so that there is an inside.
  bool is_closed() const;
};

// `split_polygons` is what reading has counted (TriangleMeshFile); it is only reported.
SurfaceReport ValidateTriangleMesh(const TriangleMesh& mesh, Eigen::Index split_polygons = 0);

// The triangles that count as degenerate_triangles, rising. Those with a corner that is not finite
// are among them.
std::vector<Eigen::Index> DegenerateTriangles(const TriangleMesh& mesh);

}  // namespace tissueform
