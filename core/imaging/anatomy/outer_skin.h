// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/imaging/anatomy/head_segmentation.h"
#include "core/imaging/ct/voxel_grid.h"

namespace tissueform {

// The outer skin of a CT is the isosurface of the head's HU at `tissue_above_hu` where it faces the
// air that reaches the outside, but not through nostrils or mouth.

struct OuterSkinOptions {
  // Of the ball that the air must let through: larger than a nostril or parted lips.
  double opening_radius_mm = 6;
  // How far the air reaches on into creases that are too narrow for the ball: beside the nose,
  // under the lip, at the corners of eyes. As far it reaches into nostrils and between the lips.
  double crease_mm = 4;
};

// Of a mask of air, what a ball of `radius_mm` covers that comes from outside. Beyond the grid all
// goes on as at its border.
LabelGrid AirReachedByBall(const LabelGrid& air, double radius_mm);

// The voxels of air (1) that the outer skin faces, on the head's grid. A windpipe that is cut by
// the border of the CT is no way in, as the air beyond the grid goes on as at its border.
LabelGrid OutsideAir(const HeadSegmentation& head, const OuterSkinOptions& options = {});

// The voxels of the mask that have a face on one of `outside_air`: those that carry the outer skin.
LabelGrid VoxelsFacing(const LabelGrid& outside_air, const LabelGrid& mask);

// Distance from `seeds` on ways from voxel to voxel of `mask` (through edges and corners only where
// all voxels about them are in it), up to `reach_mm`; beyond it, and outside the mask, infinite.
// Steps are 1, sqrt 2 and sqrt 3 voxels long: at most 8 % longer than the way itself.
VoxelGrid<float> DistanceWithin(const LabelGrid& mask, const LabelGrid& seeds, double reach_mm);

}  // namespace tissueform
