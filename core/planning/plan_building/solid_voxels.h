// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>

#include <Eigen/Geometry>

#include "core/imaging/anatomy/grid_operations.h"
#include "core/imaging/anatomy/itk_filters.h"
#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// A box at whose faces a surface ends without being closed there, as where an image ended.
struct OpenBox {
  Eigen::AlignedBox3d box;
  std::array<bool, 3> low = {};  // whether the surface is open at the face across each axis
  std::array<bool, 3> high = {};

  bool any() const;
};

struct SolidVoxels {
  LabelGrid inside;  // 1 where most rays say so
  double inside_mm3 = 0;
  double turned_mm3 = 0;  // where most rays say that the surface faces inward
};

// The voxels whose centers a surface encloses. Along each of six directions (both ways along the
// axes) the surface is crossed outward once more than inward from a point inside; four of six
// directions must agree. So holes, gaps and openings that leave most directions closed do no harm,
// nor do parts that overlap. A ray that enters more often than it leaves is taken to leave at the
// box's face where that is open. The triangles must face outward, apart from the walls of cavities.
// Does not depend on `threads`.
SolidVoxels FindSolidVoxels(const TriangleMesh& surface, const GridGeometry& geometry, int threads,
                            const OpenBox& open = {});

// Distances from the voxels' centers to the surface in mm, positive inside, exact within two voxels
// of the border of `inside` and limited to +- two voxels elsewhere.
FloatGrid DistancesNearBorder(const LabelGrid& inside, const TriangleMesh& surface, int threads);

}  // namespace tissueform
