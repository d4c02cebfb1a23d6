// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <limits>

#include "absl/status/statusor.h"

#include "core/imaging/ct/voxel_grid.h"
#include "core/mesh/triangle_mesh.h"

namespace tissueform {

struct SurfaceExtractionOptions {
  float level = 0;

  // In the unit of the grid: values that are closer to the level are moved away from it to this
  // distance, on their side. The surface then keeps off the voxel centres, where it would have
  // needles and triangles without area.
  float clearance = 0;

  // Smaller cavities are filled.
  double min_cavity_volume_mm3 = 0;

  // Other parts that enclose at least this are kept beside the largest, also those in its cavities.
  double min_part_volume_mm3 = std::numeric_limits<double>::infinity();
};

// Where a grid, linear between its voxel centres, has the value `level` (vtkFlyingEdges3D), as one
// closed surface in mm: the part that encloses the largest volume of higher values, facing
// outwards, and the walls of the cavities inside it, facing into them. Smaller parts are left out
// unless the options keep them, also those that float in a cavity. Where higher values reach the
// border of the grid the surface runs half a voxel outside its last centres, where those voxels
// end. Deterministic.
//
// Errors: InvalidArgument when no voxel is above the level, when a value is not finite, or when the
// grid's size and values disagree.
absl::StatusOr<TriangleMesh> ExtractSurface(const VoxelGrid<float>& grid,
                                            const SurfaceExtractionOptions& options = {});

}  // namespace tissueform
