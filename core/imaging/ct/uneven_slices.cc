// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/uneven_slices.h"

#include <algorithm>

#include "core/imaging/ct/voxel_grid.h"

namespace tissueform {
namespace {

constexpr double kRounding = 1e-6;  // of a voxel, or mm

}  // namespace

UnevenSlices::UnevenSlices(const CtVolume& volume)
    : volume_(volume), normal_(volume.direction.col(0).cross(volume.direction.col(1))) {
  for (const Eigen::Vector3d& origin : volume.slice_origins_mm) {
    heights_.push_back(HeightOf(origin));
  }
}

std::optional<double> UnevenSlices::ValueAt(const Eigen::Vector3d& place_mm) const {
  const double height = HeightOf(place_mm);
  const size_t last = heights_.size() - 1;
  const auto above = std::upper_bound(heights_.begin() + 1, heights_.end() - 1, height);
  const auto upper = static_cast<size_t>(above - heights_.begin());
  const double part = (height - heights_[upper - 1]) / (heights_[upper] - heights_[upper - 1]);
  if (part < -0.5 - kRounding || part > 1.5 + kRounding) return std::nullopt;
  const size_t nearest = part < 0.5 ? upper - 1 : std::min(upper, last);
  const Eigen::Vector2d at = InSlice(place_mm, nearest);
  const Eigen::Vector2d end(volume_.size[0] - 0.5, volume_.size[1] - 0.5);
  if ((at.array() < -0.5 - kRounding).any() || (at.array() > end.array() + kRounding).any()) {
    return std::nullopt;
  }
  const double t = std::clamp(part, 0.0, 1.0);
  return (1 - t) * ValueIn(upper - 1, InSlice(place_mm, upper - 1)) +
         t * ValueIn(upper, InSlice(place_mm, upper));
}

Eigen::AlignedBox3d UnevenSlices::Box() const {
  Eigen::AlignedBox3d box;
  const Eigen::Matrix3d steps = volume_.StepsMm();
  const size_t last = heights_.size() - 1;
  const double below_mm = (heights_[1] - heights_[0]) / 2;
  const double above_mm = (heights_[last] - heights_[last - 1]) / 2;
  for (size_t k = 0; k <= last; ++k) {
    const double out_mm = k == 0 ? -below_mm : (k == last ? above_mm : 0);
    for (const double i : {-0.5, volume_.size[0] - 0.5}) {
      for (const double j : {-0.5, volume_.size[1] - 0.5}) {
        box.extend(volume_.slice_origins_mm[k] + steps * Eigen::Vector3d(i, j, 0) +
                   out_mm * normal_);
      }
    }
  }
  return box;
}

double UnevenSlices::smallest_gap_mm() const {
  double smallest = heights_[1] - heights_[0];
  for (size_t k = 1; k < heights_.size(); ++k) {
    smallest = std::min(smallest, heights_[k] - heights_[k - 1]);
  }
  return smallest;
}

Eigen::Vector2d UnevenSlices::InSlice(const Eigen::Vector3d& place_mm, size_t k) const {
  const Eigen::Vector3d offset = place_mm - volume_.slice_origins_mm[k];
  return {volume_.direction.col(0).dot(offset) / volume_.spacing_mm[0],
          volume_.direction.col(1).dot(offset) / volume_.spacing_mm[1]};
}

double UnevenSlices::ValueIn(size_t k, const Eigen::Vector2d& at) const {
  return VoxelCell({at.x(), at.y(), 0}, {volume_.size[0], volume_.size[1], 1})
      .Mean([&](int i, int j, int /*k*/) {
        return static_cast<double>(volume_.At(i, j, static_cast<int>(k)));
      });
}

}  // namespace tissueform
