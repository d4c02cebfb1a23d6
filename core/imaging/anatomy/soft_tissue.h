// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"

#include "core/imaging/anatomy/grid_operations.h"
#include "core/imaging/anatomy/head_segmentation.h"
#include "core/imaging/anatomy/itk_filters.h"
#include "core/imaging/anatomy/landmarks.h"
#include "core/imaging/anatomy/plane.h"
#include "core/imaging/ct/voxel_grid.h"

namespace tissueform {

// Planes whose positive sides together hold what is modelled.
struct RegionOfInterest {
  Plane back;   // normal to the front
  Plane above;  // normal down
  Plane below;  // normal up

  std::vector<Plane> planes() const { return {back, above, below}; }
};

// Back: 5 mm behind the angles of the jaw. Above: 58 mm over the nasal floor, which takes the
// orbits in. Below: 15 mm under the chin. All upright, and at least one voxel within the image.
RegionOfInterest DefaultRegion(const Landmarks& landmarks, const GridGeometry& geometry);

struct SoftTissueOptions {
  // Behind the outer skin there is at least so much tissue, if need be in place of air or bone;
  // other sheets and strings that are thinner are left out.
  double thinnest_mm = 3;
  double narrowest_neck_mm = 16;     // through less than that the brain hangs on the face
  double smallest_cavity_mm3 = 150;  // air and specks of bone that are smaller are filled
};

// Label of soft tissue in SoftTissue::labels.
inline constexpr uint8_t kSoftTissue = 255;

// All grids have one geometry: the voxels of the region of interest and two more on each side where
// the image has them.
struct SoftTissue {
  // 0 outside, air, brain; 1 fixed bone; 2.. the segments; 255 soft tissue, one connected
  // component.
  LabelGrid labels;

  // Positive inside, 0 on the surface, about mm within a voxel of it (values end there, at about
  // one voxel). Along skin, airway and bone it is linear in the HU, so that its zero level is that
  // of the CT at the thresholds of the segmentation, true to a part of a voxel; along the planes of
  // the region it is the distance from them; where something was left out or filled, a smoothed
  // distance.
  FloatGrid field;

  double volume_mm3 = 0;    // of the soft tissue's voxels
  double left_out_mm3 = 0;  // soft voxels in the box that are not in it: brain, marrow, thin sheets
  double filled_mm3 = 0;    // voxels in it that are not soft: behind thin skin, small cavities
  RegionOfInterest region;

  LabelGrid outside_air;  // OutsideAir(head), on the head's grid
};

// Soft tissue = head minus bone minus air minus brain inside the region.
//
// `bone_labels` are those of CutSegments, on the head's grid. Errors: InvalidArgument when the
// region holds none, less than 20 cm3, or a plane of it leaves nothing.
absl::StatusOr<SoftTissue> ExtractSoftTissue(const HeadSegmentation& head,
                                             const LabelGrid& bone_labels,
                                             const Landmarks& landmarks,
                                             const RegionOfInterest& region,
                                             const SoftTissueOptions& options = {},
                                             const StageFunction& on_stage = nullptr);

}  // namespace tissueform
