// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/labels/label_resample.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace tissueform::testing {
namespace {

constexpr StructureSet kJaw = SetOf(Structure::kLowerJaw);
constexpr StructureSet kTeeth = SetOf(Structure::kLowerTeeth);

LabelMap MapOf(int size, double spacing_mm) {
  LabelMap map;
  map.size = {size, size, size};
  map.steps_mm = spacing_mm * Eigen::Matrix3d::Identity();
  map.structures.assign(static_cast<size_t>(map.num_voxels()), 0);
  return map;
}

void Set(LabelMap* map, int i, int j, int k, StructureSet set) {
  map->structures[static_cast<size_t>(i + map->size[0] * (j + map->size[1] * k))] = set;
}

TEST(LabelResampleTest, TakesTheNearestVoxelOfACoarserMap) {
  LabelMap map = MapOf(2, 3);
  Set(&map, 1, 0, 0, kJaw | kTeeth);
  const LabelledGrid labels = ResampleLabels(map, {.size = {6, 1, 1}, .spacing_mm = 1}, 2);
  EXPECT_THAT(labels.structures.values,
              ::testing::ElementsAre(0, 0, kJaw | kTeeth, kJaw | kTeeth, kJaw | kTeeth, 0));
  EXPECT_THAT(labels.covered.values, ::testing::ElementsAre(1, 1, 1, 1, 1, 0));
  EXPECT_EQ(labels.voxel_mm, 3);
}

// A wall in 2 of 4 voxels of the map is in 3 of 5 samples of a voxel of the grid; one in 1 of 4 is
// in 1 of 5.
TEST(LabelResampleTest, KeepsPartialVolumesOfAFinerMap) {
  LabelMap map = MapOf(8, 0.5);
  for (int k = 0; k < 8; ++k) {
    for (int j = 0; j < 8; ++j) {
      Set(&map, 2, j, k, kJaw);
      Set(&map, 3, j, k, kJaw);
      Set(&map, 5, j, k, kTeeth);
    }
  }
  const GridGeometry grid{.size = {2, 1, 1}, .origin_mm = {0.75, 1.75, 1.75}, .spacing_mm = 2};
  const LabelledGrid labels = ResampleLabels(map, grid, 1);
  EXPECT_THAT(labels.structures.values, ::testing::ElementsAre(kJaw, 0));
  EXPECT_EQ(labels.voxel_mm, 2);
}

TEST(LabelResampleTest, FollowsTurnedAxes) {
  LabelMap map = MapOf(3, 1);
  map.steps_mm << 0, -1, 0, 1, 0, 0, 0, 0, 1;  // i grows to the back, j to the right
  map.origin_mm = {2, 0, 0};
  Set(&map, 2, 1, 0, kJaw);
  const LabelledGrid labels = ResampleLabels(map, {.size = {3, 3, 1}, .spacing_mm = 1}, 1);
  EXPECT_EQ(labels.structures.At(1, 2, 0), kJaw);
}

}  // namespace
}  // namespace tissueform::testing
