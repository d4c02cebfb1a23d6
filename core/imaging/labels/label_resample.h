// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/imaging/ct/voxel_grid.h"
#include "core/imaging/labels/label_map.h"

namespace tissueform {

// Structures on the grid of a CT.
struct LabelledGrid {
  VoxelGrid<StructureSet> structures;
  LabelGrid covered;  // 1 where the label map has voxels, labelled or not
  // How coarse it is: the larger of both grids' voxels, in mm.
  double voxel_mm = 0;
};

// A voxel gets the labels of the nearest voxel of the map. Where the map is finer, it gets each
// structure that fills more than half of it, by 3 x 3 x 3 or 5 x 5 x 5 samples, so that partial
// volumes are not lost. The result does not depend on the number of threads.
LabelledGrid ResampleLabels(const LabelMap& map, const GridGeometry& grid, int threads);

}  // namespace tissueform
