// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>

#include "absl/strings/string_view.h"
#include <Eigen/Core>

namespace tissueform {

// SOP classes of CT images.
inline constexpr absl::string_view kCtImageClass = "1.2.840.10008.5.1.4.1.1.2";
inline constexpr absl::string_view kEnhancedCtImageClass = "1.2.840.10008.5.1.4.1.1.2.1";
inline constexpr absl::string_view kLegacyEnhancedCtImageClass = "1.2.840.10008.5.1.4.1.1.2.2";

// Whether objects of this SOP class are images of a CT, of one frame or of several: the only ones
// of a series that a plan is built of.
bool IsCtClass(absl::string_view class_uid);

// Farther away nothing is scanned; sums of squares stay finite.
inline constexpr double kMaxPositionMm = 1e5;

// What the choice of a series reads from the header of an image, whichever library has read the
// file. Texts are trimmed, and empty where the image says nothing. Several values have "\\"
// between.
struct ImageHeader {
  std::string study_uid = {};
  std::string series_uid = {};
  std::string class_uid = {};
  std::string frame_uid = {};  // of reference

  std::string modality = {};
  std::string series_description = {};
  std::string convolution_kernel = {};
  std::string image_type = {};            // "ORIGINAL\\PRIMARY\\AXIAL"
  std::string contrast = {};              // the agent
  std::optional<int> series_number = {};  // 0 is a number, too
  std::optional<int> acquisition_number = {};
  std::optional<int> instance_number = {};

  int rows = 0;
  int columns = 0;
  std::optional<Eigen::Vector3d> position_mm = {};       // LPS: centre of the first pixel
  std::optional<Eigen::Matrix<double, 3, 2>> axes = {};  // along a row, along a column
  std::optional<Eigen::Vector2d> pixel_spacing_mm = {};  // between rows, between columns
  std::optional<double> slice_thickness_mm = {};
  std::optional<double> rescale_slope = {};  // to HU; without slope and intercept HU are unknown
  std::optional<double> rescale_intercept = {};
  std::string rescale_type = {};
};

bool IsLocaliser(const ImageHeader& image);

// Row direction x column direction, as long as the header makes it. REQUIRES: axes.
Eigen::Vector3d SliceNormal(const ImageHeader& image);

}  // namespace tissueform
