// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/voxel_grid.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace tissueform {
namespace {

double Linear(const Eigen::Vector3d& p) { return 3 * p[0] - 5 * p[1] + 7 * p[2] + 100; }

VoxelGrid<double> LinearGrid(const std::array<int, 3>& size) {
  VoxelGrid<double> grid({.size = size, .origin_mm = {-7, 11, 40}, .spacing_mm = 1.5});
  for (int z = 0; z < size[2]; ++z) {
    for (int y = 0; y < size[1]; ++y) {
      for (int x = 0; x < size[0]; ++x) grid.At(x, y, z) = Linear(grid.geometry.Centre(x, y, z));
    }
  }
  return grid;
}

TEST(InterpolateTest, LinearPrecisionAndTheVoxelsThemselves) {
  const VoxelGrid<double> grid = LinearGrid({4, 5, 3});
  for (const Eigen::Vector3d& voxels :
       {Eigen::Vector3d(0.3, 2.6, 1.9), Eigen::Vector3d(2.999, 0.001, 0.5)}) {
    const Eigen::Vector3d place = grid.geometry.origin_mm + 1.5 * voxels;
    EXPECT_NEAR(Interpolate(grid, place), Linear(place), 1e-12);
  }
  EXPECT_EQ(Interpolate(grid, grid.geometry.Centre(3, 4, 2)), grid.At(3, 4, 2));
  EXPECT_EQ(Interpolate(grid, grid.geometry.Centre(0, 0, 0)), grid.At(0, 0, 0));
}

TEST(InterpolateTest, TheOutermostCentresHoldBeyondThem) {
  const VoxelGrid<double> grid = LinearGrid({4, 5, 3});
  EXPECT_EQ(Interpolate(grid, grid.geometry.Centre(-9, -1, -1)), grid.At(0, 0, 0));
  EXPECT_EQ(Interpolate(grid, grid.geometry.Centre(4, 50, 3)), grid.At(3, 4, 2));
}

TEST(InterpolateTest, AGridOneVoxelThickHasNoSlopeAcross) {
  const VoxelGrid<double> sheet = LinearGrid({4, 1, 1});
  const Eigen::Vector3d place = sheet.geometry.Centre(1, 0, 0) + Eigen::Vector3d(0.75, 0.4, -2);
  EXPECT_NEAR(Interpolate(sheet, place), (sheet.At(1, 0, 0) + sheet.At(2, 0, 0)) / 2, 1e-12);
}

TEST(VoxelCellTest, WeightsAreNotNegativeOneInSumAndThoseOfTheMean) {
  const VoxelGrid<double> grid = LinearGrid({4, 5, 3});
  for (const Eigen::Vector3d& voxels :
       {Eigen::Vector3d(0.3, 2.6, 1.9), Eigen::Vector3d(-2, 4, 7), Eigen::Vector3d(1, 1, 1)}) {
    const VoxelCell cell(voxels, grid.geometry.size);
    double sum = 0;
    double mean = 0;
    for (unsigned corner = 0; corner < 8; ++corner) {
      const auto [x, y, z] = cell.Corner(corner);
      EXPECT_GE(cell.Weight(corner), 0);
      sum += cell.Weight(corner);
      mean += cell.Weight(corner) * grid.At(x, y, z);
    }
    EXPECT_NEAR(sum, 1, 1e-15);
    EXPECT_NEAR(cell.Mean([&grid](int x, int y, int z) { return grid.At(x, y, z); }), mean, 1e-12);
  }
}

}  // namespace
}  // namespace tissueform
