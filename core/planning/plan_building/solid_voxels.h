// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "absl/status/statusor.h"
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

// The voxels inside a surface of a whole bone or of the skin, which messages call `what`.
//
// Errors: InvalidArgument when the surface faces inward or encloses less than 100 mm3.
absl::StatusOr<LabelGrid> SolidOf(const TriangleMesh& mesh, const std::string& what,
                                  const GridGeometry& geometry, int threads,
                                  const OpenBox& open = {});

// Gives the voxels of `inside` a label. Voxels that have one keep it.
//
// Errors: InvalidArgument when more than 5 % of them have one.
absl::Status MarkSolid(const LabelGrid& inside, const std::string& what, uint8_t label,
                       LabelGrid* labels);

// Distances from the voxels' centers to the surface in mm, positive inside, exact within two voxels
// of the border of `inside` and limited to +- two voxels elsewhere.
FloatGrid DistancesNearBorder(const LabelGrid& inside, const TriangleMesh& surface, int threads);

}  // namespace tissueform
