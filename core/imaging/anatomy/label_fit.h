// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/statusor.h"
#include <Eigen/Core>

#include "core/imaging/ct/voxel_grid.h"
#include "core/imaging/labels/label_resample.h"

namespace tissueform {

// How well labelled bone lies on the bone of a CT.
struct LabelFit {
  double on_bone = 0;  // share of the labelled bone's voxels that are dense as bone
  double on_bone_left = 0;
  double on_bone_right = 0;
  double best_on_bone = 0;  // of all moves by up to 24 mm along each axis, and mirrored ones
  Eigen::Vector3d best_move_mm = Eigen::Vector3d::Zero();
  bool best_is_mirrored = false;  // left to right, about the middle of the labels, then moved
  bool has_bone = false;          // otherwise nothing was labelled that can be compared
};

LabelFit MeasureLabelFit(const LabelledGrid& labels, const HuGrid& ct, double bone_above_hu);

// Errors: InvalidArgument for a map that does not lie on the bone of the CT, or would lie on it
// clearly better when moved or mirrored: it is of another image or patient, shifted, or mirrored.
// The move is a hint only.
absl::Status CheckLabelFit(const LabelFit& fit);

}  // namespace tissueform
