// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/accuracy/layered_block.h"

#include <algorithm>

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

TEST(LayeredBlockTest, HasTheSizeAndTheTetsOfTheMethodsBlock) {
  ASSERT_OK_AND_ASSIGN(const LayeredBlock block, MakeLayeredBlock());
  EXPECT_EQ(block.mesh.num_tets(), 20736);
  const Positions& positions = block.mesh.positions();
  EXPECT_EQ(positions.colwise().minCoeff(), Eigen::RowVector3d(0, 0, 0));
  EXPECT_EQ(positions.colwise().maxCoeff(), Eigen::RowVector3d(80, 60, 20));
}

TEST(LayeredBlockTest, TissueChangesAtTheHeightsOfTheLayers) {
  ASSERT_OK_AND_ASSIGN(const LayeredBlock block, MakeLayeredBlock());
  ASSERT_EQ(block.stiffness.size(), block.mesh.num_tets());
  for (Eigen::Index t = 0; t < block.mesh.num_tets(); ++t) {
    double height = 0;
    for (const int32_t v : block.mesh.tets().row(t)) height += block.mesh.positions()(v, 2) / 4;
    ASSERT_EQ(block.stiffness[t], height < 10 ? 30000 : height < 17.5 ? 3000 : 100000);
  }
}

TEST(LayeredBlockTest, RimOfTheBottomIsFixedFartherFromThePatchThanItMoves) {
  for (const std::array<int, 3>& cells : {kLayeredBlockCells, {12, 9, 8}, {6, 6, 4}}) {
    ASSERT_OK_AND_ASSIGN(const LayeredBlock block, MakeLayeredBlock(cells));
    const Positions fixed = block.mesh.positions()(block.constraints.fixed(), Eigen::all);
    const Positions patch =
        block.mesh.positions()(block.constraints.handles().front().vertices, Eigen::all);
    EXPECT_EQ(fixed.col(2).maxCoeff(), 0);
    EXPECT_EQ(patch.col(2).maxCoeff(), 0);
    double nearest = 1e9;
    for (const auto& v : patch.rowwise()) {
      nearest = std::min(nearest, (fixed.rowwise() - v).rowwise().norm().minCoeff());
    }
    EXPECT_GT(nearest, MoveAlong().translation_mm.x());
  }
}

TEST(LayeredBlockTest, PatchIsAThirdOfEachSide) {
  ASSERT_OK_AND_ASSIGN(const LayeredBlock block, MakeLayeredBlock());
  const std::vector<int32_t>& patch = block.constraints.handles().front().vertices;
  EXPECT_EQ(patch.size(), 9U * 7U);
  const Positions positions = block.mesh.positions()(patch, Eigen::all);
  EXPECT_NEAR(positions.col(0).minCoeff(), 80.0 / 3, 1e-9);
  EXPECT_NEAR(positions.col(1).maxCoeff(), 40, 1e-9);
}

TEST(LayeredBlockTest, MovesAreOfFiveMillimetres) {
  EXPECT_EQ(MoveAlong().translation_mm, Eigen::Vector3d(5, 0, 0));
  EXPECT_EQ(MoveUp().translation_mm, Eigen::Vector3d(0, 0, 5));
}

}  // namespace
}  // namespace tissueform
