// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "absl/status/status.h"

#include "core/mesh/attribute.h"
#include "core/mesh/mesh_defect.h"
#include "core/mesh/surface_validation.h"
#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// What is wrong with one triangle; the highest number that holds is kept.
enum class TriangleFlaw : uint8_t {
  kNone = 0,
  kTurned = 1,        // faces the other side than a neighbour
  kOpenEdge = 2,      // an edge has no other triangle
  kNonManifold = 3,   // an edge has three or more triangles
  kIntersecting = 4,  // goes through another one
  kDuplicate = 5,     // has the corners of an earlier one
  kDegenerate = 6,    // no area, or a corner that is not finite
};

// Why a surface cannot be filled with tets. The kinds are those of SurfaceReport, of which all that
// leave no inside (open_edges, non_manifold_edges, turned_triangles) are errors here, and
//   duplicate_triangles     error    triangles with the corners of an earlier one
//   intersecting_triangles  error    triangles that go through another one
//   inward_facing           warning  the surface is closed and faces inwards
struct SurfaceDefects {
  SurfaceReport report;
  std::vector<MeshDefect> defects;  // instead of report.defects; errors first
  std::vector<TriangleFlaw> flaws;  // #F
  int64_t num_intersecting_pairs = 0;
  bool found_all_pairs = true;  // false: there are even more

  bool can_be_meshed() const { return AreUsable(defects); }
  const MeshDefect* Find(std::string_view kind) const { return FindDefect(defects, kind); }
};

// Deterministic. The search for intersections ends at a million pairs.
SurfaceDefects FindSurfaceDefects(const TriangleMesh& surface);

// The flaws as an array "defect", one number a triangle, to be looked at.
Attribute FlawArray(const SurfaceDefects& defects);

// OK, or InvalidArgument: the first error explained, the other ones with their counts.
absl::Status CheckMeshable(const SurfaceDefects& defects);

}  // namespace tissueform
