// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/imaging/anatomy/landmarks.h"
#include "core/imaging/ct/voxel_grid.h"
#include "core/planning/case_file/case_file.h"
#include "core/planning/plan_building/frankfort.h"

namespace tissueform {

// The landmarks that planners read movements at, by their names in cephalometry:
//
//   bone and teeth  menton, pogonion, lower_incisor, upper_incisor, lower_ and upper_molar_left and
//                   _right, gonion_, condyle_, porion_ and orbitale_left and _right
//   skin            pronasale (where the nose is whole), subnasale, labrale_superius,
//   labrale_inferius, soft_pogonion
//
// A landmark of bone moves with the segment of its own jaw whose voxels lie nearest to it (up to
// 4 mm; nearer bone that stays holds it), one of the skin with the nearest vertex of `skin`. `bone`
// has kFixedBone and from kFirstSegment on the segments, whose names these are; `parts`, on the
// same grid, are BoneParts::labels.
std::vector<CaseLandmark> MakeViewerLandmarks(const Landmarks& landmarks,
                                              const std::optional<FrankfortLandmarks>& frankfort,
                                              const LabelGrid& bone, const LabelGrid& parts,
                                              const std::vector<std::string>& segments,
                                              const CaseSurface& skin);

}  // namespace tissueform
