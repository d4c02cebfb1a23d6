// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"

#include "core/base/process/helper_program.h"
#include "core/mesh/tet_mesh.h"
#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// The part of the inside that holds a point and is bounded by the surface.
struct MeshRegion {
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();
  int32_t attribute = 0;          // of its tets
  double max_tet_volume_mm3 = 0;  // 0: no limit of its own
};

struct TetrahedralizationOptions {
  // Quality that is tried for; a surface that is kept may not allow it near sharp edges.
  double max_radius_edge_ratio = 1.4;  // circumradius over shortest edge; TetGen ends for >= 1.2
  double min_dihedral_deg = 10;        // 0 to 18

  // 0: as large as quality allows. Tets at a surface that is kept may be larger than this and than
  // what the regions say: only a finer surface makes them smaller.
  double max_tet_volume_mm3 = 0;

  // Edge length near every vertex of the surface, #V, in mm; 0 where it is not bounded. Empty:
  // none.
  std::vector<double> edge_lengths_mm;

  std::vector<MeshRegion> regions;
  std::vector<Eigen::Vector3d> holes_mm;  // in parts that stay empty, beside the cavities

  // Whether the boundary of the mesh is the surface, triangle by triangle. Otherwise triangles may
  // be split, which allows better tets.
  bool keep_surface = true;

  IsolationLimits limits{.max_memory_bytes = int64_t{4} << 30, .max_seconds = 300};
};

struct Tetrahedralization {
  TetMesh mesh;                        // positive tets only
  std::vector<int32_t> region_of_tet;  // #T: attribute of its region, 0 outside all; empty without
};

// Edge length of the regular tet of this volume, and the reverse. For options that are in mm.
double RegularTetVolume(double edge_mm);

// Fills a closed surface with tets, by TetGen in a helper program. Walls of cavities (CavityPoints)
// and `holes_mm` bound empty space. The vertices of the surface come first, in their order; those
// that no tet needs are left out. Deterministic.
//
// Errors: InvalidArgument when an option makes no sense, when the surface has a defect (it is
// named, with its count; see FindSurfaceDefects), when TetGen gives up or ends without tets;
// ResourceExhausted when it reaches a limit.
absl::StatusOr<Tetrahedralization> Tetrahedralize(const TriangleMesh& surface,
                                                  const TetrahedralizationOptions& options = {});

}  // namespace tissueform
