// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <algorithm>
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

// The eight voxels about a place, and how far it lies from the lower to the upper ones along each
// axis, in [0, 1]. A place beyond the outermost centres is taken onto them.
struct VoxelCell {
  std::array<int, 3> lower = {0, 0, 0};
  std::array<int, 3> upper = {0, 0, 0};
  std::array<double, 3> part = {0, 0, 0};

  // `place` in units of voxels, see GridGeometry::ToVoxels.
  VoxelCell(const Eigen::Vector3d& place, const std::array<int, 3>& size) {
    for (size_t axis = 0; axis < 3; ++axis) {
      const double inside = std::clamp(place[static_cast<Eigen::Index>(axis)], 0.0,
                                       static_cast<double>(size[axis] - 1));
      lower[axis] = std::min(static_cast<int>(inside), std::max(0, size[axis] - 2));
      upper[axis] = std::min(lower[axis] + 1, size[axis] - 1);
      part[axis] = inside - lower[axis];
    }
  }

  // Corner 0 to 7: bit 0 is the upper one along x, bit 1 along y, bit 2 along z.
  std::array<int, 3> Corner(unsigned corner) const {
    std::array<int, 3> voxel{};
    for (unsigned axis = 0; axis < 3; ++axis) {
      voxel[axis] = (corner >> axis & 1U) != 0 ? upper[axis] : lower[axis];
    }
    return voxel;
  }
  // Of a corner in the trilinear mean: not negative, one in sum.
  double Weight(unsigned corner) const {
    double weight = 1;
    for (unsigned axis = 0; axis < 3; ++axis) {
      weight *= (corner >> axis & 1U) != 0 ? part[axis] : 1 - part[axis];
    }
    return weight;
  }

  // The trilinear mean of at(x, y, z): along x, then y, then z.
  template <typename At>
  double Mean(const At& at) const {
    const auto mix = [](double t, double a, double b) { return (1 - t) * a + t * b; };
    const auto row = [&](int y, int z) {
      return mix(part[0], at(lower[0], y, z), at(upper[0], y, z));
    };
    const auto slice = [&](int z) { return mix(part[1], row(lower[1], z), row(upper[1], z)); };
    return mix(part[2], slice(lower[2]), slice(upper[2]));
  }
};

// The value between the voxels' centres, linear along each axis; beyond the outermost centres those
// hold.
template <typename T>
double Interpolate(const VoxelGrid<T>& grid, const Eigen::Vector3d& place_mm) {
  return VoxelCell(grid.geometry.ToVoxels(place_mm), grid.geometry.size)
      .Mean([&grid](int x, int y, int z) { return static_cast<double>(grid.At(x, y, z)); });
}

using HuGrid = VoxelGrid<int16_t>;
using LabelGrid = VoxelGrid<uint8_t>;

}  // namespace tissueform
