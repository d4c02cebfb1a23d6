// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/experiments/block_pull_experiment.h"

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

// Half of a millimetre more than the block is thick.
constexpr double kWayMm = 3.5;

BlockProblem Block() { return SoftTissueBlock({18, 12, 3}, 1).value(); }

TEST(BlockPullTest, BottomOfTheVolumeGoesWithTheHandleAndThatOfTheSurfaceStays) {
  for (const double way : {kWayMm, -kWayMm}) {
    ASSERT_OK_AND_ASSIGN(const PullResult volume, PullVolume(Block(), way));
    ASSERT_OK_AND_ASSIGN(const PullResult surface, PullSurface(Block(), way));
    EXPECT_GT(volume.bottom_share, 0.6);
    EXPECT_LT(surface.bottom_share, 0.2);
  }
}

TEST(BlockPullTest, VolumeKeepsItsVolumeAndTheSurfaceDoesNot) {
  for (const double way : {kWayMm, -kWayMm}) {
    ASSERT_OK_AND_ASSIGN(const PullResult volume, PullVolume(Block(), way));
    ASSERT_OK_AND_ASSIGN(const PullResult surface, PullSurface(Block(), way));
    EXPECT_NEAR(volume.volume_ratio, 1, 0.1);
    EXPECT_GT(std::abs(surface.volume_ratio - 1), 0.25);
    EXPECT_EQ(volume.inverted_tets, 0);
  }
}

TEST(BlockPullTest, PushedSurfaceIntersectsItselfAndThePushedVolumeDoesNot) {
  ASSERT_OK_AND_ASSIGN(const PullResult volume, PullVolume(Block(), -kWayMm));
  ASSERT_OK_AND_ASSIGN(const PullResult surface, PullSurface(Block(), -kWayMm));
  EXPECT_EQ(volume.self_intersections, 0);
  EXPECT_GT(surface.self_intersections, 0);
}

TEST(BlockPullTest, IterationsConverge) {
  ASSERT_OK_AND_ASSIGN(const PullResult volume, PullVolume(Block(), kWayMm));
  ASSERT_OK_AND_ASSIGN(const PullResult surface, PullSurface(Block(), kWayMm));
  EXPECT_TRUE(volume.converged);
  EXPECT_TRUE(surface.converged);
}

}  // namespace
}  // namespace tissueform
