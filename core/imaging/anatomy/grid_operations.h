// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>

#include "absl/strings/string_view.h"

#include "core/imaging/ct/voxel_grid.h"

namespace tissueform {

// Called at the start of each stage of a longer work, with the share of the whole that is done
// then. May be null.
using StageFunction = std::function<void(absl::string_view stage, double fraction)>;

void ReportStage(const StageFunction& on_stage, absl::string_view stage, double fraction);

// A block of voxels of a grid: from `first` to `last`, both within.
struct VoxelBox {
  std::array<int, 3> first = {0, 0, 0};
  std::array<int, 3> last = {-1, -1, -1};

  bool empty() const { return last[0] < first[0]; }
};

// The smallest box round all voxels that are not 0.
VoxelBox BoundingBox(const LabelGrid& labels);

// Larger by that many voxels on every side, within the grid.
VoxelBox Grown(const VoxelBox& box, int voxels, const GridGeometry& geometry);

// Number of voxels that are not 0.
int64_t CountVoxels(const LabelGrid& mask);

double VoxelVolumeMm3(const GridGeometry& geometry);

// Of all voxels that are not 0, together.
double VolumeMm3(const LabelGrid& mask);

// 1 where both are not 0. REQUIRES: one geometry.
LabelGrid Both(LabelGrid a, const LabelGrid& b);

// The part of a grid inside the box, with the same places.
// REQUIRES: the box lies inside the grid and is not empty.
template <typename T>
VoxelGrid<T> Crop(const VoxelGrid<T>& grid, const VoxelBox& box) {
  GridGeometry geometry;
  for (size_t axis = 0; axis < 3; ++axis) {
    geometry.size[axis] = box.last[axis] - box.first[axis] + 1;
  }
  geometry.spacing_mm = grid.geometry.spacing_mm;
  geometry.origin_mm = grid.geometry.Centre(box.first[0], box.first[1], box.first[2]);
  VoxelGrid<T> part;
  part.geometry = geometry;
  part.values.reserve(static_cast<size_t>(geometry.num_voxels()));
  for (int z = box.first[2]; z <= box.last[2]; ++z) {
    for (int y = box.first[1]; y <= box.last[1]; ++y) {
      const auto row = grid.values.begin() + grid.geometry.Index(box.first[0], y, z);
      part.values.insert(part.values.end(), row, row + geometry.size[0]);
    }
  }
  return part;
}

// The voxel nearest to a place whose label is wanted, among those at most `reach` voxels from it
// along each axis; of those equally near the first in memory.
template <typename Wanted>
std::optional<Eigen::Vector3i> NearestVoxel(const LabelGrid& labels, const Eigen::Vector3d& place,
                                            int reach, Wanted wanted) {
  const Eigen::Vector3d at = labels.geometry.ToVoxels(place);
  const Eigen::Vector3i centre = at.array().round().cast<int>();
  std::optional<Eigen::Vector3i> nearest;
  double smallest = std::numeric_limits<double>::infinity();
  for (int z = centre.z() - reach; z <= centre.z() + reach; ++z) {
    for (int y = centre.y() - reach; y <= centre.y() + reach; ++y) {
      for (int x = centre.x() - reach; x <= centre.x() + reach; ++x) {
        if (!labels.geometry.Contains(x, y, z) || !wanted(labels.At(x, y, z))) continue;
        const double distance = (Eigen::Vector3d(x, y, z) - at).squaredNorm();
        if (distance < smallest) {
          smallest = distance;
          nearest = Eigen::Vector3i(x, y, z);
        }
      }
    }
  }
  return nearest;
}

// Calls visit(index, centre_mm) for every voxel where `mask` is not 0, in the order of the memory.
template <typename Visit>
void ForEachVoxel(const LabelGrid& mask, Visit visit) {
  size_t index = 0;
  for (int z = 0; z < mask.geometry.size[2]; ++z) {
    for (int y = 0; y < mask.geometry.size[1]; ++y) {
      for (int x = 0; x < mask.geometry.size[0]; ++x, ++index) {
        if (mask.values[index] != 0) visit(index, mask.geometry.Centre(x, y, z));
      }
    }
  }
}

// The mask of the voxels for which inside(value) holds.
template <typename T, typename Predicate>
LabelGrid MaskWhere(const VoxelGrid<T>& grid, Predicate inside) {
  LabelGrid mask(grid.geometry);
  for (size_t i = 0; i < grid.values.size(); ++i) {
    mask.values[i] = inside(grid.values[i]) ? 1 : 0;
  }
  return mask;
}

}  // namespace tissueform
