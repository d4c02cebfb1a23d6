// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>

#include "core/imaging/anatomy/bone_pieces.h"
#include "core/imaging/anatomy/head_segmentation.h"

namespace tissueform {

// What metal does to bone. Internal to core/imaging/anatomy. Without metal these change nothing.

// Takes from head->bone what streaks have left in it, and gives it tissue's density in head->hu:
// ledges within the heights of the metal that are no taller than 3.5 mm and lie more than 2 mm from
// bone that is. A jaw and its teeth go on above or below; what remains of a streak ends with the
// slices it was in. Returns the volume in mm3.
double RemoveStreaks(HeadSegmentation* head);

// Gives metal to the teeth it sits on. `labels` are those of the parts of the bone, 0 outside, and
// those of metal are assigned again: each piece (brackets with their wire, a filling) goes to the
// part that it touches most. A piece that touches another part a quarter as much or more holds
// fillings of both, and so may every piece with a cut, which stands for jaws that touch: these go
// voxel by voxel to the nearest part. With a cut, voxels within 5 mm of metal stay on their side of
// the plane, upper jaw above and lower below: there the density, which separates the parts, is the
// metal's.
void AssignMetal(const HeadSegmentation& head, const DentalCut* cut, LabelGrid* labels);

}  // namespace tissueform
