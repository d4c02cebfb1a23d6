// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "core/imaging/ct/voxel_grid.h"

namespace tissueform {

using FloatGrid = VoxelGrid<float>;

// Plain functions over ITK's filters, and distances, which are ours (distance_transform) because
// they are asked for twenty times a plan and ITK's take three times as long: a mask is a LabelGrid
// whose voxels are inside where not 0. Results do not depend on the number of threads. What lies
// beyond the grid counts as outside.
//
// REQUIRES, of all: a grid of at least 2 voxels along each axis.

// How many threads they use from now on, in this process; without a call all processors.
// REQUIRES: threads >= 1.
void SetFilterThreads(int threads);

// Which voxels touch.
enum class Neighbours {
  kFaces,    // 6
  kCorners,  // 26
};

// Connected parts of a mask, numbered 1, 2, .. by falling size; 0 outside.
struct Components {
  VoxelGrid<int32_t> labels;
  std::vector<int64_t> voxels;  // of component i + 1

  // The component as a mask, empty if no component has that number.
  LabelGrid Mask(int32_t component) const;
};

// Parts of fewer than `min_voxels` are left out (0).
Components LabelComponents(const LabelGrid& mask, Neighbours neighbours, int64_t min_voxels = 1);

// The largest part, empty when the mask is.
LabelGrid LargestComponent(const LabelGrid& mask, Neighbours neighbours);

// Euclidean distance of every voxel's centre from the nearest centre inside the mask; 0 inside.
// A large number everywhere when the mask is empty.
FloatGrid DistanceMm(const LabelGrid& mask);

// Distance from the border, positive inside: half-way between neighbouring voxels it is 0.
FloatGrid SignedDistanceMm(const LabelGrid& mask);

// Morphology with a ball. The border of the grid does not erode.
LabelGrid Erode(const LabelGrid& mask, double radius_mm);
LabelGrid Dilate(const LabelGrid& mask, double radius_mm);
LabelGrid Open(const LabelGrid& mask, double radius_mm);
LabelGrid Close(const LabelGrid& mask, double radius_mm);

// Floods `height` from the markers (labels from 1; 0 is unlabelled), the lowest voxel first, over
// the faces, and keeps what lies in the mask. Every voxel of the mask gets a label when there is a
// marker.
LabelGrid WatershedFromMarkers(const VoxelGrid<int16_t>& height, const LabelGrid& markers,
                               const LabelGrid& mask);

// Gaussian of that standard deviation; values beyond the grid are those of its border.
FloatGrid GaussianSmooth(const FloatGrid& grid, double sigma_mm);

}  // namespace tissueform
