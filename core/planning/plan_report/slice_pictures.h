// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "core/planning/plan_building/plan_builder.h"
#include "core/planning/rendering/panels.h"

namespace tissueform {

// A plane through the head as it is laid on a picture.
struct SlicePlane {
  std::string title;
  Eigen::Vector3d through_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::UnitX();  // in the picture; unit vectors
  Eigen::Vector3d down = Eigen::Vector3d::UnitY();
  std::string at_left = {};  // sides of the patient
  std::string at_right = {};
  std::string at_top = {};
  std::string at_bottom = {};
};

// Axial through the lower teeth, coronal through the lower molars and through the condyles, and
// midsagittal. Radiological convention: the patient's right is at the left of the picture, and a
// sagittal slice looks to the left of the picture.
std::vector<SlicePlane> PlanSlices(const Landmarks& landmarks);

// Radiological convention, as above.
SlicePlane AxialSlice(const std::string& title, const Eigen::Vector3d& through_mm);

// A CT in grey (-300 to 900 HU) over the extent of that grid.
Picture DrawPlainSlice(const HuGrid& hu, const GridGeometry& over, const SlicePlane& plane);

// The CT in grey (-300 to 900 HU) with soft tissue, fixed bone and segments in their colours, each
// with its outline, over the whole extent of the head's grid.
Picture DrawSlice(const PlanBuild& build, const SlicePlane& plane);

// Where the label map and the CT disagree on bone: the CT in grey with LabelAgreement::difference
// in the colors of DifferenceColour. REQUIRES: build.labels.
Picture DrawLabelDifference(const PlanBuild& build, const SlicePlane& plane);
Colour DifferenceColour(uint8_t difference);

// Where the skin was carried over in slices with metal: the CT in grey with PlanBuild::carried_skin
// in its color, if any.
Picture DrawCarriedSkin(const PlanBuild& build, const SlicePlane& plane);
Colour CarriedSkinColour(uint8_t carried);

}  // namespace tissueform
