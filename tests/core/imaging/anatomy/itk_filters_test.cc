// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/itk_filters.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/imaging/anatomy/grid_operations.h"

namespace tissueform {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;

GridGeometry Cube(int size, double spacing_mm = 1) {
  GridGeometry geometry;
  geometry.size = {size, size, size};
  geometry.spacing_mm = spacing_mm;
  return geometry;
}

template <typename Inside>
LabelGrid Mask(const GridGeometry& geometry, Inside inside) {
  LabelGrid all(geometry, 1);
  LabelGrid mask(geometry);
  ForEachVoxel(all, [&](size_t index, const Eigen::Vector3d& place) {
    mask.values[index] = inside(place) ? 1 : 0;
  });
  return mask;
}

LabelGrid RandomMask(const GridGeometry& geometry, unsigned one_in) {
  std::mt19937 generator(7);
  LabelGrid mask(geometry);
  for (uint8_t& value : mask.values) value = generator() % one_in == 0 ? 1 : 0;
  return mask;
}

TEST(ItkFiltersTest, DistanceIsThatOfTheNearestVoxel) {
  const LabelGrid mask = RandomMask(Cube(14, 1.5), 60);
  const FloatGrid distance = DistanceMm(mask);
  const LabelGrid all(mask.geometry, 1);
  ForEachVoxel(all, [&](size_t index, const Eigen::Vector3d& place) {
    double nearest = 1e9;
    ForEachVoxel(mask, [&](size_t, const Eigen::Vector3d& other) {
      nearest = std::min(nearest, (place - other).norm());
    });
    ASSERT_NEAR(distance.values[index], nearest, 1e-4);
  });
}

TEST(ItkFiltersTest, SignedDistanceVanishesHalfWayBetweenVoxels) {
  const LabelGrid half = Mask(Cube(12, 2), [](const auto& p) { return p.x() < 11; });
  const FloatGrid distance = SignedDistanceMm(half);
  for (int x = 0; x < 12; ++x) EXPECT_NEAR(distance.At(x, 5, 5), 11 - 2 * x, 1e-5);
}

TEST(ItkFiltersTest, OpeningRemovesTheThinAndKeepsTheThick) {
  const GridGeometry geometry = Cube(40);
  const auto ball = [](const auto& p) { return (p - Eigen::Vector3d(14, 20, 20)).norm() < 10; };
  const auto rod = [](const auto& p) { return std::hypot(p.y() - 20, p.z() - 20) < 2.5; };
  const LabelGrid opened =
      Open(Mask(geometry, [&](const auto& p) { return ball(p) || rod(p); }), 4);
  EXPECT_EQ(opened.At(34, 20, 20), 0);
  EXPECT_EQ(opened.At(14, 20, 20), 1);
  const auto kept = static_cast<double>(CountVoxels(opened));
  EXPECT_NEAR(kept, static_cast<double>(CountVoxels(Mask(geometry, ball))), 0.04 * kept);
}

TEST(ItkFiltersTest, ClosingFillsGapsAndTheBordersOfTheGridDoNotErode) {
  const LabelGrid plates =
      Mask(Cube(24), [](const auto& p) { return std::abs(p.x() - 12) > 1.5 || p.y() > 20; });
  EXPECT_EQ(CountVoxels(Close(plates, 2)), plates.geometry.num_voxels());
  const LabelGrid half = Mask(Cube(24), [](const auto& p) { return p.x() < 12; });
  EXPECT_EQ(CountVoxels(Erode(half, 2)), 10 * 24 * 24);
  EXPECT_EQ(CountVoxels(Dilate(half, 2)), 14 * 24 * 24);
}

TEST(ItkFiltersTest, ComponentsComeByFallingSizeAndSpecksAreLeftOut) {
  LabelGrid mask(Cube(10));
  for (int x = 0; x < 3; ++x) mask.At(x, 0, 0) = 1;
  for (int x = 0; x < 6; ++x) mask.At(x, 5, 5) = 1;
  mask.At(9, 9, 9) = 1;
  mask.At(6, 6, 6) = 1;  // touches the row of six by a corner
  EXPECT_THAT(LabelComponents(mask, Neighbours::kFaces).voxels, ElementsAre(6, 3, 1, 1));
  const Components corners = LabelComponents(mask, Neighbours::kCorners, 2);
  EXPECT_THAT(corners.voxels, ElementsAre(7, 3));
  EXPECT_EQ(corners.labels.At(6, 6, 6), 1);
  EXPECT_EQ(corners.labels.At(0, 0, 0), 2);
  EXPECT_EQ(corners.labels.At(9, 9, 9), 0);
  EXPECT_EQ(CountVoxels(LargestComponent(mask, Neighbours::kFaces)), 6);
}

TEST(ItkFiltersTest, WatershedPartsAtTheRidgeAndStaysInTheMask) {
  const LabelGrid mask = Mask(Cube(21), [](const auto& p) { return std::abs(p.y() - 10) < 4; });
  VoxelGrid<int16_t> height(mask.geometry);
  LabelGrid markers(mask.geometry);
  const LabelGrid all(mask.geometry, 1);
  ForEachVoxel(all, [&](size_t index, const Eigen::Vector3d& p) {
    height.values[index] = static_cast<int16_t>(-std::lround(10 * std::abs(p.x() - 13)));
  });
  markers.At(0, 10, 10) = 1;
  markers.At(20, 10, 10) = 2;
  const LabelGrid parts = WatershedFromMarkers(height, markers, mask);
  ForEachVoxel(all, [&](size_t index, const Eigen::Vector3d& p) {
    const int expected = mask.values[index] == 0 ? 0 : p.x() < 13 ? 1 : 2;
    if (p.x() == 13) return;  // the ridge itself
    ASSERT_EQ(parts.values[index], expected) << p.transpose();
  });
}

TEST(ItkFiltersTest, SmoothingKeepsConstantsAndSums) {
  EXPECT_THAT(GaussianSmooth(FloatGrid(Cube(9), 3.5F), 1.2).values,
              Each(::testing::FloatNear(3.5F, 1e-5F)));
  FloatGrid point(Cube(21, 2));
  point.At(10, 10, 10) = 1000;
  const FloatGrid smooth = GaussianSmooth(point, 3);
  double sum = 0;
  double second_moment = 0;
  for (int x = 0; x < 21; ++x) {
    for (int y = 0; y < 21; ++y) {
      for (int z = 0; z < 21; ++z) {
        sum += smooth.At(x, y, z);
        second_moment += smooth.At(x, y, z) * std::pow(2.0 * (x - 10), 2);
      }
    }
  }
  EXPECT_NEAR(sum, 1000, 1);
  EXPECT_NEAR(std::sqrt(second_moment / sum), 3, 0.15);
}

TEST(ItkFiltersTest, EmptyMasksStayEmpty) {
  const LabelGrid none(Cube(5));
  EXPECT_EQ(CountVoxels(Open(none, 2)), 0);
  EXPECT_EQ(CountVoxels(Dilate(none, 2)), 0);
  EXPECT_EQ(CountVoxels(LargestComponent(none, Neighbours::kFaces)), 0);
  EXPECT_EQ(CountVoxels(Erode(LabelGrid(Cube(5), 1), 2)), 125);
}

}  // namespace
}  // namespace tissueform
