// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/case_file/skin_follow.h"

#include "gtest/gtest.h"

#include "core/planning/case_file/mesh_surfaces.h"
#include "tests/testing/meshes.h"

namespace tissueform {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

// A bar of 20 by 20 by 40 mm whose lower end is fixed and whose upper one is moved.
class SkinFollowTest : public ::testing::Test {
 protected:
  SkinFollowTest() : skin_(*SkinOfMesh(bar_, ends_, {})) {}

  // The bar's own skin, moved away from it by so much along its sides' normals.
  FloatPositions MovedOut(double by_mm) const {
    const Eigen::RowVector3f middle(10, 10, 0);
    FloatPositions moved = skin_.positions;
    for (auto row : moved.rowwise()) {
      for (int axis = 0; axis < 2; ++axis) {
        row[axis] += static_cast<float>(by_mm) * (row[axis] > 15  ? 1.0F
                                                  : row[axis] < 5 ? -1.0F
                                                                  : 0);
      }
    }
    return moved;
  }
  Eigen::VectorXf SumsAt(double by_mm) const {
    return FollowSkin(MovedOut(by_mm), skin_.triangles, bar_, ends_).weights.rowwise().sum();
  }

  const TetMesh bar_ = testing::Bar({2, 2, 4}, 10);
  const ConstraintSet ends_ = testing::BarEnds(bar_);
  const CaseSurface skin_;
};

TEST_F(SkinFollowTest, OnTheMeshEveryVertexFollowsItsOwnPlace) {
  const FollowedVertices follows = FollowSkin(skin_.positions, skin_.triangles, bar_, ends_);
  for (Index v = 0; v < skin_.positions.rows(); ++v) {
    Vector3d place = Vector3d::Zero();
    for (int k = 0; k < 3; ++k) {
      place +=
          double{follows.weights(v, k)} * bar_.positions().row(follows.vertices(v, k)).transpose();
    }
    EXPECT_LT((place.cast<float>() - skin_.positions.row(v).transpose()).norm(), 1e-4);
  }
}

TEST_F(SkinFollowTest, NearTheMeshVerticesFollowInFull) {
  EXPECT_NEAR(SumsAt(2).minCoeff(), 1, 1e-5);
}

TEST_F(SkinFollowTest, FartherOffTheyFollowLessAndThenNotAtAll) {
  const Eigen::VectorXf half = SumsAt(3.9);
  EXPECT_LT(half.minCoeff(), 0.95F);
  EXPECT_GT(half.minCoeff(), 0.05F);
  EXPECT_EQ(SumsAt(9).maxCoeff(), 0);
}

TEST_F(SkinFollowTest, ASurfaceThatFacesTheOtherWayDoesNotFollow) {
  const TriangleIndices turned = skin_.triangles(Eigen::all, std::array<int, 3>{0, 2, 1});
  const FollowedVertices follows = FollowSkin(MovedOut(1), turned, bar_, ends_);
  Index followers = 0;
  for (Index v = 0; v < follows.weights.rows(); ++v) followers += follows.weights(v, 0) > 0;
  EXPECT_EQ(followers, 0);
}

TEST_F(SkinFollowTest, RegionsAreThoseOfTheVertexThatIsFollowedMost) {
  FollowedVertices follows;
  follows.vertices.resize(3, 3);
  follows.vertices << 0, 1, 2, 2, 1, 0, 1, 1, 1;
  follows.weights.resize(3, 3);
  follows.weights << 0.2F, 0.7F, 0.1F, 0.6F, 0.2F, 0.2F, 0, 0, 0;
  EXPECT_EQ(RegionsOfFollowers(follows, {4, 5, 6}), (std::vector<uint8_t>{5, 6, 0}));
  EXPECT_TRUE(RegionsOfFollowers(follows, {}).empty());
}

}  // namespace
}  // namespace tissueform
