// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/case_file/parted_skin.h"

#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "gtest/gtest.h"

#include "core/planning/case_file/mesh_surfaces.h"
#include "core/planning/case_file/skin_follow.h"
#include "tests/testing/meshes.h"

namespace tissueform {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

constexpr double kSeamMm = 20;

// A bar of 20 by 20 by 40 mm that is cut in halfway up from x = 0 to x = 10, with the doubles
// below.
class PartedSkinTest : public ::testing::Test {
 protected:
  PartedSkinTest() {
    const TetMesh whole = testing::Bar({4, 4, 8}, 5);
    std::map<int32_t, int32_t> double_of;
    std::vector<Vector3d> places;
    for (const auto& place : whole.positions().rowwise()) places.emplace_back(place.transpose());
    for (int32_t v = 0; v < whole.num_vertices(); ++v) {
      const Vector3d place = whole.positions().row(v);
      if (place.z() != kSeamMm || place.x() > 5) continue;
      double_of[v] = static_cast<int32_t>(places.size());
      rows_.push_back({.vertex = double_of[v], .other = v, .normal = -Vector3d::UnitZ()});
      places.push_back(place);
    }
    TetIndices tets = whole.tets();
    for (auto tet : tets.rowwise()) {
      double height = 0;
      for (const int32_t v : tet) height += whole.positions()(v, 2) / 4;
      if (height > kSeamMm) continue;
      for (int32_t& v : tet) v = double_of.contains(v) ? double_of[v] : v;
    }
    Positions positions(static_cast<Index>(places.size()), 3);
    for (size_t v = 0; v < places.size(); ++v) {
      positions.row(static_cast<Index>(v)) = places[v].transpose();
    }
    mesh_.emplace(*TetMesh::Create(std::move(positions), std::move(tets)));
    ends_.emplace(testing::BarEnds(*mesh_));
  }

  // The front at x = 0 in one piece and finer than the mesh: no vertex lies on the seam.
  CaseSurface Front() const {
    constexpr int kAcross = 10;
    constexpr int kUp = 21;
    CaseSurface front;
    front.positions.resize((kAcross + 1) * (kUp + 1), 3);
    front.triangles.resize(2 * kAcross * kUp, 3);
    Index next = 0;
    for (int k = 0; k <= kUp; ++k) {
      for (int j = 0; j <= kAcross; ++j) {
        const int32_t v = k * (kAcross + 1) + j;
        front.positions.row(v) << 0, 20.0F * static_cast<float>(j) / kAcross,
            40.0F * static_cast<float>(k) / kUp;
        if (k == kUp || j == kAcross) continue;
        front.triangles.row(next++) << v, v + kAcross + 1, v + 1;
        front.triangles.row(next++) << v + 1, v + kAcross + 1, v + kAcross + 2;
      }
    }
    front.follows = FollowSkin(front.positions, front.triangles, *mesh_, *ends_);
    return front;
  }

  // Moves the lower lip down by 5 mm at the seam and less to the fixed end.
  FloatPositions Opened(const CaseSurface& skin) const {
    FloatPositions moved = skin.positions;
    for (Index v = 0; v < moved.rows(); ++v) {
      for (int k = 0; k < 3; ++k) {
        moved(v, 2) -= skin.follows->weights(v, k) * Drop(skin.follows->vertices(v, k));
      }
    }
    return moved;
  }

  float Drop(int32_t vertex) const {
    const bool is_double = vertex >= mesh_->num_vertices() - static_cast<int32_t>(rows_.size());
    const double height = mesh_->positions()(vertex, 2);
    return is_double || height < kSeamMm ? static_cast<float>(5 * height / kSeamMm) : 0;
  }

  static float LongestEdge(const FloatPositions& positions, const TriangleIndices& triangles) {
    float longest = 0;
    for (const auto& triangle : triangles.rowwise()) {
      for (int k = 0; k < 3; ++k) {
        const auto edge = positions.row(triangle[k]) - positions.row(triangle[(k + 1) % 3]);
        longest = std::max(longest, edge.norm());
      }
    }
    return longest;
  }

  std::vector<ContactRow> rows_;
  std::optional<TetMesh> mesh_;
  std::optional<ConstraintSet> ends_;
};

TEST_F(PartedSkinTest, NoTriangleIsDrawnOutBetweenTheLips) {
  CaseSurface skin = Front();
  const float at_rest = LongestEdge(skin.positions, skin.triangles);
  EXPECT_GT(LongestEdge(Opened(skin), skin.triangles), at_rest + 4);
  PartSkin(*mesh_, *ends_, rows_, &skin);
  EXPECT_LT(LongestEdge(Opened(skin), skin.triangles), at_rest + 0.6);
}

TEST_F(PartedSkinTest, AtRestNothingIsMoved) {
  const CaseSurface before = Front();
  CaseSurface skin = before;
  PartSkin(*mesh_, *ends_, rows_, &skin);
  EXPECT_GT(skin.positions.rows(), before.positions.rows());
  EXPECT_EQ(skin.follows->vertices.rows(), skin.positions.rows());
  EXPECT_EQ(FloatPositions(skin.positions.topRows(before.positions.rows())), before.positions);
  for (Index t = 0; t < skin.triangles.rows(); ++t) {
    for (int k = 0; k < 3; ++k) {
      EXPECT_EQ(skin.positions.row(skin.triangles(t, k)),
                before.positions.row(before.triangles(t, k)));
    }
  }
}

TEST_F(PartedSkinTest, WithoutASeamItStaysAsItIs) {
  const CaseSurface before = Front();
  CaseSurface skin = before;
  PartSkin(*mesh_, *ends_, {}, &skin);
  EXPECT_EQ(skin.positions, before.positions);
  EXPECT_EQ(skin.triangles, before.triangles);
  EXPECT_FALSE(InsidesOfLips(*mesh_, *ends_, {}));
}

TEST_F(PartedSkinTest, TheInsidesAreBothSidesOfTheSeam) {
  const std::optional<CaseSurface> insides = InsidesOfLips(*mesh_, *ends_, rows_);
  ASSERT_TRUE(insides);
  double area_mm2 = 0;
  double up_mm2 = 0;
  for (const auto& triangle : insides->triangles.rowwise()) {
    const auto corner = [&](int k) -> Eigen::Vector3f {
      return insides->positions.row(triangle[k]);
    };
    const Eigen::Vector3f normal = (corner(1) - corner(0)).cross(corner(2) - corner(0)) / 2;
    area_mm2 += double{normal.norm()};
    up_mm2 += double{normal.z()};
    for (int k = 0; k < 3; ++k) EXPECT_EQ(corner(k).z(), kSeamMm);
  }
  EXPECT_NEAR(area_mm2, 2 * 20 * 10, 1e-3);
  EXPECT_NEAR(up_mm2, 0, 1e-3);
}

}  // namespace
}  // namespace tissueform
