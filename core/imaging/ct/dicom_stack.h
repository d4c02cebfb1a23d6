// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include <Eigen/Core>

#include "core/imaging/ct/dicom_header.h"

namespace tissueform {

// Slices in the order in which they are stacked: along their common normal (row direction x column
// direction).
struct DicomStack {
  std::vector<DicomHeader> slices;
  Eigen::Vector3d spacing_mm = Eigen::Vector3d::Ones();
  Eigen::Matrix3d direction = Eigen::Matrix3d::Identity();  // as in CtVolume
  std::vector<Eigen::Vector3d> slice_origins_mm;            // as in CtVolume
  double gantry_tilt_deg = 0;
  std::vector<std::string> notes;
};

// Sorts the slices of a chosen series and finds their geometry from positions and orientation.
// Notes say when slices are missing or lie unevenly, and when their rescale differs.
//
// Errors: InvalidArgument, naming the slice, when a tag is missing; when slices differ in size,
// orientation or pixel spacing; when there are too few, or two at one place; when a gap,
// the spacing or the tilt is absurd. `may_lack_rescale` says that the recipe states what the values
// are, so that rescale tags may be missing.
absl::Status ArrangeStack(bool may_lack_rescale, DicomStack* stack);

}  // namespace tissueform
