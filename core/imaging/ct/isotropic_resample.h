// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/statusor.h"

#include "core/imaging/ct/ct_volume.h"
#include "core/imaging/ct/voxel_grid.h"

namespace tissueform {

struct ResampleOptions {
  int threads = 1;                       // does not change the result
  int64_t max_bytes = int64_t{2} << 30;  // of the grid; asked before it is allocated
};

// HU on an upright grid of cubic voxels that covers the volume's box (the box of its voxels, not
// only of their centres): round(extent / spacing) voxels along each axis, centred on it, so that a
// volume that is such a grid already stays as it is. Values are interpolated linearly between voxel
// centres, also in sheared volumes (gantry tilt) and, along the slices' normal, between slices that
// lie unevenly; up to half a voxel (half of the first or last gap) outside the outermost centres
// the border's values hold, and beyond that there is air (-1024).
//
// Where the grid is coarser than the volume, the value is the mean over the new voxel: of n samples
// along each axis, where n = ceil(spacing / distance of the volume's samples along that axis), at
// most
// 8. A linear function of position is so reproduced exactly (to the rounding to whole HU), for any
// direction of the volume.
//
// Errors: InvalidArgument unless spacing_mm is in [0.1, 10]; ResourceExhausted beyond max_bytes.
absl::StatusOr<HuGrid> ResampleIsotropic(const CtVolume& volume, double spacing_mm,
                                         const ResampleOptions& options = {});

}  // namespace tissueform
