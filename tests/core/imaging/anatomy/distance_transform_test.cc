// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/distance_transform.h"

#include <algorithm>
#include <limits>
#include <random>

#include "gtest/gtest.h"

namespace tissueform {
namespace {

LabelGrid RandomMask(const std::array<int, 3>& size, unsigned one_in) {
  GridGeometry geometry;
  geometry.size = size;
  LabelGrid mask(geometry);
  std::mt19937 generator(3);
  for (uint8_t& value : mask.values) value = generator() % one_in == 0 ? 7 : 0;
  return mask;
}

std::vector<Eigen::Vector3i> VoxelsOf(const LabelGrid& mask) {
  std::vector<Eigen::Vector3i> voxels;
  for (int z = 0; z < mask.geometry.size[2]; ++z) {
    for (int y = 0; y < mask.geometry.size[1]; ++y) {
      for (int x = 0; x < mask.geometry.size[0]; ++x) {
        if (mask.At(x, y, z) != 0) voxels.emplace_back(x, y, z);
      }
    }
  }
  return voxels;
}

// Asked of every voxel one by one.
VoxelGrid<int32_t> NearestOfAll(const LabelGrid& mask) {
  const std::vector<Eigen::Vector3i> inside = VoxelsOf(mask);
  VoxelGrid<int32_t> squares(mask.geometry);
  for (const Eigen::Vector3i& voxel : VoxelsOf(LabelGrid(mask.geometry, 1))) {
    int32_t least = std::numeric_limits<int32_t>::max();
    for (const Eigen::Vector3i& other : inside) {
      least = std::min(least, (voxel - other).squaredNorm());
    }
    squares.At(voxel.x(), voxel.y(), voxel.z()) = least;
  }
  return squares;
}

TEST(DistanceTransformTest, SquaresAreThoseOfTheNearestVoxelForAnyNumberOfThreads) {
  // Sparse and dense, longer than a block of lines along each axis and not a multiple of it.
  for (const unsigned one_in : {2U, 40U, 400U}) {
    for (const auto& size : {std::array{37, 9, 5}, std::array{5, 37, 9}, std::array{9, 5, 37}}) {
      const LabelGrid mask = RandomMask(size, one_in);
      ASSERT_FALSE(VoxelsOf(mask).empty());
      const VoxelGrid<int32_t> expected = NearestOfAll(mask);
      for (const int threads : {1, 2, 5}) {
        EXPECT_EQ(SquaredDistanceVoxels(mask, threads).values, expected.values)
            << one_in << " " << threads;
      }
    }
  }
}

TEST(DistanceTransformTest, OneVoxelIsSeenFromEveryCorner) {
  GridGeometry geometry;
  geometry.size = {100, 120, 140};
  LabelGrid mask(geometry);
  mask.At(99, 0, 139) = 1;
  const VoxelGrid<int32_t> squares = SquaredDistanceVoxels(mask, 2);
  EXPECT_EQ(squares.At(0, 119, 0), 99 * 99 + 119 * 119 + 139 * 139);
  EXPECT_EQ(squares.At(0, 0, 139), 99 * 99);
  EXPECT_EQ(squares.At(99, 119, 139), 119 * 119);
  EXPECT_EQ(squares.At(99, 0, 0), 139 * 139);
}

}  // namespace
}  // namespace tissueform
