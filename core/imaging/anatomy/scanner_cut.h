// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/imaging/anatomy/landmarks.h"
#include "core/imaging/anatomy/plane.h"
#include "core/imaging/ct/voxel_grid.h"
#include "core/mesh/skin_region.h"

namespace tissueform {

// Where the scanner's circle, or a side of the CT, cuts a head: what ends there goes on in the
// patient, and its end is no skin.

// The head's voxels (1) with a face on what was not scanned, or on the grid's sides (left, right,
// front, back; above and below the region of interest ends the model). Connected pieces of less
// than 10 mm2 do not count: a sharp edge by chance. `unscanned` may have no voxels; the result has
// no voxels where nothing is cut.
LabelGrid CutVoxels(const LabelGrid& head, const LabelGrid& unscanned);

// A connected piece of it.
struct ScannerCut {
  double area_mm2 = 0;
  // Of it, by number of SkinRegion; where the skin would be is not known, so names are by the cut.
  std::vector<double> region_mm2;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  Eigen::Vector3d low = Eigen::Vector3d::Zero();
  Eigen::Vector3d high = Eigen::Vector3d::Zero();
};

// The pieces of `cut` on the positive side of the planes, 10 mm2 or more each, by falling area. An
// area is that of the sum of its faces as vectors: exact where it is flat, and hardly less where it
// is a part of a circle.
std::vector<ScannerCut> MeasureCuts(const LabelGrid& cut, const LabelGrid& head,
                                    const std::vector<Plane>& planes, const Landmarks& landmarks);

// How much of a part of the bone lies below the grid, in mm, estimated from how its cross-sections
// grow over the border; infinite where they do not. None where the part does not touch the border.
std::optional<double> CutOffBelowMm(const LabelGrid& labels, uint8_t label);

}  // namespace tissueform
