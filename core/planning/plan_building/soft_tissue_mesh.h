// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/base/process/helper_program.h"
#include "core/imaging/ct/voxel_grid.h"
#include "core/mesh/generation/surface_remeshing.h"
#include "core/mesh/tet_mesh.h"
#include "core/mesh/tet_quality.h"
#include "core/mesh/triangle_mesh.h"

namespace tissueform {

struct SoftTissueMeshOptions {
  double edge_mm = 4;                    // of the surface's triangles
  std::vector<FineRegion> fine_regions;  // lips and chin, where shorter edges are wanted
  double interior_edge_factor = 1.5;     // inside, edges may be longer by this

  // Smaller cavities of the grid are filled.
  double min_cavity_volume_mm3 = 200;

  double min_dihedral_deg = 10;  // that is tried for

  // When no mesh without intersections is found, everything is tried again with edges shorter by
  // `retry_factor`.
  int max_attempts = 4;
  double retry_factor = 0.8;

  int threads = 1;  // nothing depends on it

  IsolationLimits limits{.max_memory_bytes = int64_t{4} << 30, .max_seconds = 300};

  // Called with what begins: "surface of the soft tissue", ... An error ends the work with it.
  std::function<absl::Status(absl::string_view stage)> on_stage;
};

// How far points lie from a surface.
struct SurfaceDistances {
  double mean_mm = 0;
  double p99_mm = 0;
  double max_mm = 0;
};

struct SoftTissueMeshReport {
  double edge_mm = 0;  // of the attempt that succeeded
  int attempts = 0;
  std::vector<int64_t> repaired_pairs;  // see RemeshedSurface
  Eigen::Index surface_vertices = 0;
  Eigen::Index cavities = 0;
  double grid_volume_mm3 = 0;  // inside the isosurface of the grid, small cavities filled
  double volume_ratio = 0;     // of the mesh's volume to the grid's
  TetQualitySummary quality;
  Eigen::Index tets_below_3_deg = 0;  // smallest dihedral angle under 3 degrees
  SurfaceDistances to_isosurface;     // from the vertices of the mesh's boundary
  SurfaceDistances from_isosurface;   // of the isosurface's vertices to the mesh's boundary
};

struct SoftTissueMesh {
  TetMesh mesh;          // positive tets, one component; its boundary vertices come first
  TriangleMesh surface;  // the boundary, facing outwards; vertex k is vertex k of the mesh
  SoftTissueMeshReport report;
};

// Measures again what the report says of the tets and the surface's vertices, for a mesh that was
// changed.
void MeasureTets(SoftTissueMesh* made);

// Tets in the soft tissue: `heights` is positive inside it, about the distance to its boundary in
// mm. The boundary becomes a closed surface (ExtractSurface), remeshed (RemeshSurface) and filled
// with tets (Tetrahedralize). Of parts that hang together nowhere the largest is meshed.
// Deterministic.
//
// Errors: InvalidArgument when there is no soft tissue, when an option makes no sense, or when the
// last attempt fails too; ResourceExhausted over a limit; what `on_stage` returns.
absl::StatusOr<SoftTissueMesh> MeshSoftTissue(const VoxelGrid<float>& heights,
                                              const SoftTissueMeshOptions& options = {});

}  // namespace tissueform
