// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include <Eigen/Core>

#include "core/imaging/labels/label_map.h"

namespace gdcm {
class DataSet;
}

namespace tissueform {

// A frame of a DICOM SEG.
struct SegFrame {
  int segment = 0;  // number of its segment; 0 where pixels hold the numbers
  Eigen::Vector3d position_mm = Eigen::Vector3d::Zero();
  int slice = 0;  // of the grid
};

// The grid of all frames. A SEG has frames only where a segment is: slices may have none.
struct SegGrid {
  std::array<int, 3> size = {0, 0, 0};
  Eigen::Vector3d origin_mm = Eigen::Vector3d::Zero();
  Eigen::Matrix3d steps_mm = Eigen::Matrix3d::Identity();
  std::vector<SegFrame> frames;  // in the order of the file
};

// Places the frames by the functional groups, shared or their own (DICOM PS3.3, C.8.20.2). In the
// helper program only.
//
// Errors: InvalidArgument when a frame has no position, orientation, spacing or segment, or frames
// are not the slices of one volume; ResourceExhausted beyond `max_voxels`.
absl::StatusOr<SegGrid> PlaceSegFrames(const gdcm::DataSet& data, int64_t max_voxels);

// What arranges the frames; the last step of PlaceSegFrames, without DICOM. `step_mm` is the
// distance of slices that the file states, 0 where it does not. REQUIRES: there are frames.
absl::Status ArrangeSegFrames(const Eigen::Vector3d& row_direction,
                              const Eigen::Vector3d& column_direction,
                              const Eigen::Vector2d& pixel_spacing_mm, double step_mm,
                              SegGrid* grid);

}  // namespace tissueform
