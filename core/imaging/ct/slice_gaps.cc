// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/slice_gaps.h"

#include <algorithm>

#include <Eigen/Geometry>

namespace tissueform {
namespace {

constexpr double kRoundingMm = 0.01;  // of positions in headers: 5.00 mm is not far apart

// Square to the voxels' other two axes, toward the patient's head, back or left, so that heights
// along upright slices are LPS coordinates.
Eigen::Vector3d NormalOf(const CtVolume& volume, int axis) {
  const Eigen::Vector3d normal =
      volume.direction.col((axis + 1) % 3).cross(volume.direction.col((axis + 2) % 3)).normalized();
  Eigen::Index largest = 0;
  normal.cwiseAbs().maxCoeff(&largest);
  return normal[largest] < 0 ? Eigen::Vector3d(-normal) : normal;
}

std::vector<double> HeightsAlong(const CtVolume& volume, int axis, const Eigen::Vector3d& normal) {
  std::vector<double> heights;
  for (int i = 0; i < volume.size[static_cast<size_t>(axis)]; ++i) {
    const std::array<int, 3> voxel = {axis == 0 ? i : 0, axis == 1 ? i : 0, axis == 2 ? i : 0};
    heights.push_back(normal.dot(volume.Place(voxel[0], voxel[1], voxel[2])));
  }
  std::sort(heights.begin(), heights.end());
  return heights;
}

void AddGap(const SliceGap& gap, std::vector<SliceGap>* gaps) {
  const bool goes_on =
      !gaps->empty() && gaps->back().normal == gap.normal && gaps->back().to_mm == gap.from_mm;
  if (!goes_on) {
    gaps->push_back(gap);
    return;
  }
  gaps->back().to_mm = gap.to_mm;
  gaps->back().largest_mm = std::max(gaps->back().largest_mm, gap.largest_mm);
}

}  // namespace

std::vector<SliceGap> FindWideGaps(const CtVolume& volume) {
  std::vector<SliceGap> gaps;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d normal = NormalOf(volume, axis);
    const std::vector<double> heights = HeightsAlong(volume, axis, normal);
    for (size_t i = 1; i < heights.size(); ++i) {
      const double apart_mm = heights[i] - heights[i - 1];
      if (apart_mm > kFarApartMm + kRoundingMm) {
        AddGap({normal, heights[i - 1], heights[i], apart_mm}, &gaps);
      }
    }
  }
  return gaps;
}

}  // namespace tissueform
