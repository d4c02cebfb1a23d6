// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/imaging/ct/voxel_grid.h"

namespace tissueform {

// Squared Euclidean distance of every voxel's center from the nearest center that is not 0 in the
// mask, in voxels: whole numbers, exact; 0 inside. Axis after axis, along each by the lower
// envelope of parabolas (Meijster, Roerdink and Hesselink 2000), so the time is proportional to the
// number of voxels for any distances. The result does not depend on `threads`.
//
// REQUIRES: the mask is not empty; no axis has more than 16,384 voxels.
VoxelGrid<int32_t> SquaredDistanceVoxels(const LabelGrid& mask, int threads);

}  // namespace tissueform
