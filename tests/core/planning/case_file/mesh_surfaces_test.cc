// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/case_file/mesh_surfaces.h"

#include "gtest/gtest.h"
#include <Eigen/Geometry>

#include "tests/testing/meshes.h"

namespace tissueform {
namespace {

using Eigen::Index;
using Eigen::Vector3f;

// A bar of 4 by 4 by 8 facets, whose lowest layer is fixed and whose highest is the handle "top".
class MeshSurfacesTest : public ::testing::Test {
 protected:
  const TetMesh bar_ = testing::Bar({2, 2, 4}, 10);
  const ConstraintSet ends_ = testing::BarEnds(bar_);
};

Vector3f NormalOf(const CaseSurface& surface, Index triangle) {
  const auto corner = [&](int k) -> Vector3f {
    return surface.positions.row(surface.triangles(triangle, k));
  };
  return (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized();
}

TEST_F(MeshSurfacesTest, SkinIsTheBoundaryBetweenFixedAndMoved) {
  const auto skin = SkinOfMesh(bar_, ends_, {});
  ASSERT_TRUE(skin.has_value());
  EXPECT_EQ(skin->triangles.rows(), 4 * 2 * 4 * 2);  // four sides
  for (Index f = 0; f < skin->triangles.rows(); ++f) {
    EXPECT_LT(std::abs(NormalOf(*skin, f).z()), 1e-6);
  }
}

TEST_F(MeshSurfacesTest, SkinFollowsItsOwnVertices) {
  const auto skin = SkinOfMesh(bar_, ends_, {});
  ASSERT_TRUE(skin.has_value() && skin->follows.has_value());
  for (Index v = 0; v < skin->positions.rows(); ++v) {
    const Vector3f followed = bar_.positions().row(skin->follows->vertices(v, 0)).cast<float>();
    EXPECT_EQ(followed, Vector3f(skin->positions.row(v)));
    EXPECT_EQ(skin->follows->weights.row(v), Eigen::RowVector3f(1, 0, 0));
  }
}

TEST_F(MeshSurfacesTest, RegionsGoWithTheirVertices) {
  std::vector<uint8_t> regions;
  for (Index v = 0; v < bar_.num_vertices(); ++v) {
    regions.push_back(bar_.positions()(v, 2) > 15 ? 4 : 0);
  }
  const auto skin = SkinOfMesh(bar_, ends_, regions);
  ASSERT_TRUE(skin.has_value());
  for (Index v = 0; v < skin->positions.rows(); ++v) {
    EXPECT_EQ(skin->regions[static_cast<size_t>(v)], skin->positions(v, 2) > 15 ? 4 : 0);
  }
}

TEST_F(MeshSurfacesTest, SegmentsFaceOutOfTheirBone) {
  const std::vector<CaseSurface> segments = SegmentsOfMesh(bar_, ends_);
  ASSERT_EQ(segments.size(), 1U);
  EXPECT_EQ(segments[0].name, "top");
  EXPECT_EQ(segments[0].handle, "top");
  EXPECT_EQ(segments[0].kind, SurfaceKind::kSegment);
  EXPECT_EQ(segments[0].triangles.rows(), 2 * 2 * 2);
  for (Index f = 0; f < segments[0].triangles.rows(); ++f) {
    EXPECT_NEAR(NormalOf(segments[0], f).z(), -1, 1e-6);  // bone lies above the tissue
  }
}

TEST_F(MeshSurfacesTest, WhereNothingIsFreeThereIsNoSkin) {
  std::vector<int32_t> all;
  for (int32_t v = 1; v < bar_.num_vertices(); ++v) all.push_back(v);
  const ConstraintSet held = *ConstraintSet::Create(bar_, {0}, {{"rest", all}});
  EXPECT_FALSE(SkinOfMesh(bar_, held, {}).has_value());
}

}  // namespace
}  // namespace tissueform
