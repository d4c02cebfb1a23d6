// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/face_relief.h"

#include <cmath>
#include <limits>

#include "core/imaging/anatomy/grid_operations.h"
#include "core/imaging/anatomy/itk_filters.h"

namespace tissueform {
namespace {

constexpr double kAirHu = -1000;
// Between hair, which a CT blurs into the air about it, and fat (-100) with the dark streaks that
// metal throws.
constexpr double kSkinHu = -300;
// A hit so near to voxels of the cut lies on their faces, not on skin.
constexpr double kAtCutVoxels = 1.2;

// Rays that run back through a head.
class FrontRays {
 public:
  FrontRays(const HeadSegmentation& head, const FaceAxes& axes, const ReliefExtent& extent)
      : hu_(head.hu),
        to_cut_(head.cut.values.empty() ? FloatGrid() : DistanceMm(head.cut)),
        axes_(axes),
        extent_(extent) {}

  double FrontAt(double left, double up) const {
    const double step_mm = hu_.geometry.spacing_mm / 2;
    double before_hu = kAirHu;
    const auto steps = static_cast<int>(extent_.depth_mm / step_mm);
    for (int step = 0; step < steps; ++step) {
      const double front = extent_.foremost_mm - step * step_mm;
      const Eigen::Vector3d place = axes_.Place({left, front, up});
      const double hu = IsInside(place) ? Interpolate(hu_, place) : kAirHu;
      if (hu > kSkinHu) {
        if (IsAtCut(place)) return std::numeric_limits<double>::quiet_NaN();
        return front + step_mm * (hu - kSkinHu) / (hu - before_hu);
      }
      before_hu = hu;
    }
    return -std::numeric_limits<double>::infinity();
  }

 private:
  // Interpolation goes on beyond the grid, where a ray has met nothing yet.
  bool IsInside(const Eigen::Vector3d& place) const {
    const Eigen::Array3d voxel = hu_.geometry.ToVoxels(place).array();
    const Eigen::Array3d last(hu_.geometry.size[0] - 1, hu_.geometry.size[1] - 1,
                              hu_.geometry.size[2] - 1);
    return (voxel >= 0).all() && (voxel <= last).all();
  }
  bool IsAtCut(const Eigen::Vector3d& place) const {
    return !to_cut_.values.empty() &&
           Interpolate(to_cut_, place) < kAtCutVoxels * hu_.geometry.spacing_mm;
  }

  const HuGrid& hu_;
  FloatGrid to_cut_;
  FaceAxes axes_;
  ReliefExtent extent_;
};

}  // namespace

FaceRelief MeasureFaceRelief(const HeadSegmentation& head, const FaceAxes& axes,
                             const ReliefExtent& extent) {
  FaceRelief relief;
  relief.right_mm = -extent.half_width_mm;
  relief.bottom_mm = extent.bottom_mm;
  const auto columns =
      static_cast<Eigen::Index>(std::lround(2 * extent.half_width_mm / relief.column_mm)) + 1;
  const auto rows =
      static_cast<Eigen::Index>(std::lround((extent.top_mm - extent.bottom_mm) / relief.row_mm)) +
      1;
  relief.front_mm.resize(rows, columns);
  const FrontRays rays(head, axes, extent);
  for (Eigen::Index column = 0; column < columns; ++column) {
    for (Eigen::Index row = 0; row < rows; ++row) {
      relief.front_mm(row, column) = rays.FrontAt(relief.LeftOf(column), relief.UpOf(row));
    }
  }
  return relief;
}

}  // namespace tissueform
