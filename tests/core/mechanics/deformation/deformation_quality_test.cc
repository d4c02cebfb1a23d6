// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/deformation_quality.h"

#include "gtest/gtest.h"

#include "core/mesh/tet_quality.h"
#include "tests/testing/meshes.h"

namespace tissueform {
namespace {

TEST(MeasureDeformationTest, UniformScaleChangesEveryVolumeByItsCube) {
  const TetMesh bar = testing::Bar({2, 2, 2}, 1.0, 0.2);
  const DeformationQuality quality = MeasureDeformation(bar, 1.5 * bar.positions());
  EXPECT_NEAR(quality.min_volume_ratio, 3.375, 1e-12);
  EXPECT_NEAR(quality.max_volume_ratio, 3.375, 1e-12);
  EXPECT_NEAR(quality.total_volume_ratio, 3.375, 1e-12);
  EXPECT_EQ(quality.inverted_tets, 0);
}

TEST(MeasureDeformationTest, ReflectionInvertsEveryTet) {
  const TetMesh bar = testing::Bar({2, 2, 2});
  Positions reflected = bar.positions();
  reflected.col(0) *= -1;
  const DeformationQuality quality = MeasureDeformation(bar, reflected);
  EXPECT_EQ(quality.inverted_tets, bar.num_tets());
  EXPECT_NEAR(quality.total_volume_ratio, -1, 1e-12);
  EXPECT_DOUBLE_EQ(quality.max_displacement_mm, 4);
}

TEST(MeasureDeformationTest, FlattenedTetCountsAsInverted) {
  const TetMesh tet = testing::SingleTet();
  Positions flat = tet.positions();
  flat.col(2).setZero();
  EXPECT_EQ(MeasureDeformation(tet, flat).inverted_tets, 1);
}

TEST(MeasureDeformationTest, TheWorstTetIsNamed) {
  const TetMesh bar = testing::Bar({2, 2, 2});
  Positions pushed = bar.positions();
  const int32_t corner = bar.tets()(17, 0);
  const Eigen::RowVector3d opposite =
      (bar.positions().row(bar.tets()(17, 1)) + bar.positions().row(bar.tets()(17, 2)) +
       bar.positions().row(bar.tets()(17, 3))) /
      3;
  pushed.row(corner) += 1.5 * (opposite - pushed.row(corner));
  const DeformationQuality quality = MeasureDeformation(bar, pushed);
  EXPECT_GT(quality.inverted_tets, 0);
  const Eigen::VectorXd volumes = TetVolumes(pushed, bar.tets());
  EXPECT_EQ(volumes[quality.worst_tet], volumes.minCoeff()) << "all rest volumes are equal";
}

}  // namespace
}  // namespace tissueform
