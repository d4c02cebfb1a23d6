// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include <Eigen/Core>

namespace tissueform {

// Place and size of a regular grid of cubic voxels whose axes are the patient's (DICOM LPS): x
// grows toward the left, y toward the back, z toward the head.
struct GridGeometry {
  std::array<int, 3> size = {0, 0, 0};                  // voxels along x, y, z
  Eigen::Vector3d origin_mm = Eigen::Vector3d::Zero();  // centre of voxel (0, 0, 0)
  double spacing_mm = 1;

  int64_t num_voxels() const { return int64_t{size[0]} * size[1] * size[2]; }
  int64_t Index(int x, int y, int z) const {
    return x + int64_t{size[0]} * (y + int64_t{size[1]} * z);
  }
  bool Contains(int x, int y, int z) const {
    return x >= 0 && y >= 0 && z >= 0 && x < size[0] && y < size[1] && z < size[2];
  }
  Eigen::Vector3d Centre(int x, int y, int z) const {
    return origin_mm + spacing_mm * Eigen::Vector3d(x, y, z);
  }
  // Where a point lies in units of voxels: (0, 0, 0) is the centre of the first.
  Eigen::Vector3d ToVoxels(const Eigen::Vector3d& point_mm) const {
    return (point_mm - origin_mm) / spacing_mm;
  }
};

// One value a voxel, x fastest. CT numbers (HU) are int16_t, labels uint8_t.
template <typename T>
struct VoxelGrid {
  GridGeometry geometry;
  std::vector<T> values;

  VoxelGrid() = default;
  explicit VoxelGrid(const GridGeometry& grid, T value = T())
      : geometry(grid), values(static_cast<size_t>(grid.num_voxels()), value) {}

  T At(int x, int y, int z) const { return values[static_cast<size_t>(geometry.Index(x, y, z))]; }
  T& At(int x, int y, int z) { return values[static_cast<size_t>(geometry.Index(x, y, z))]; }
};

using HuGrid = VoxelGrid<int16_t>;
using LabelGrid = VoxelGrid<uint8_t>;

}  // namespace tissueform
