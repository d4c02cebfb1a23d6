// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <Eigen/Core>

#include "core/imaging/anatomy/landmarks.h"
#include "core/imaging/ct/voxel_grid.h"

namespace tissueform {

// Where upper and lower lip are one piece of tissue. In a CT with a closed mouth nothing shows
// where one lip ends; a model of it cannot part them.
struct LipContact {
  double examined_mm = 0;  // along the mouth, about its middle
  double width_mm = 0;     // of it, where no air parts the lips
  double area_mm2 = 0;     // of the tissue that joins them there, where it is least deep
  double depth_mm = 0;     // of it, from the skin to the teeth or the mouth's air: the mean
  Eigen::Vector3d place_mm = Eigen::Vector3d::Zero();  // its middle, LPS; 0 without contact
};

// Looks from the front between the heights of the lips' foremost points: 15 mm to either side of
// the midline, beyond which the corners of an open mouth may lie. Where some line of sight meets no
// tissue, or less than 3 mm of it (a tube's wall), or only tissue that lies behind the lips (the
// tongue), the lips are parted.
//
// `labels` are those of SoftTissue: what is modelled.
LipContact MeasureLipContact(const LabelGrid& labels, const Landmarks& landmarks);

}  // namespace tissueform
