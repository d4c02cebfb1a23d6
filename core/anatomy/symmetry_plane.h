// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/anatomy/plane.h"
#include "core/ct/voxel_grid.h"

namespace tissueform {

// The plane in which the mask is most like its mirror image: it minimises the mean distance (at
// most 6 mm each) of the mirrored voxels from the mask. Found by a search that halves its steps,
// from the plane x = start_x_mm, turned by up to about 16 degrees about y and z and moved by about
// 16 mm. The normal points to the patient's left.
//
// REQUIRES: the mask is not empty.
Plane FindSymmetryPlane(const LabelGrid& mask, double start_x_mm);

}  // namespace tissueform
