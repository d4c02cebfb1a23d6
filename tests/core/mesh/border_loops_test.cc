// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/border_loops.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "gtest/gtest.h"

#include "core/mesh/surface_validation.h"

namespace tissueform {
namespace {

// An octahedron without the triangles that `left_out` names.
TriangleMesh Octahedron(const std::vector<int>& left_out) {
  Positions positions(6, 3);
  positions << 1, 0, 0, 0, 1, 0, -1, 0, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1;
  std::vector<Eigen::RowVector3i> faces;
  for (int side = 0; side < 4; ++side) {
    faces.emplace_back(side, (side + 1) % 4, 4);
    faces.emplace_back((side + 1) % 4, side, 5);
  }
  TriangleIndices triangles(8 - static_cast<Eigen::Index>(left_out.size()), 3);
  Eigen::Index row = 0;
  for (int f = 0; f < 8; ++f) {
    if (std::find(left_out.begin(), left_out.end(), f) == left_out.end()) {
      triangles.row(row++) = faces[static_cast<size_t>(f)];
    }
  }
  return *TriangleMesh::Create(std::move(positions), std::move(triangles));
}

TEST(BorderLoopsTest, ClosedSurfaceHasNoBorderLoops) {
  EXPECT_TRUE(BorderLoops(Octahedron({})).empty());
}

TEST(BorderLoopsTest, FindsAnOpeningAndItsWidth) {
  const TriangleMesh mesh = Octahedron({0});
  const auto loops = BorderLoops(mesh);
  ASSERT_EQ(loops.size(), 1);
  EXPECT_EQ(loops[0].size(), 3);
  EXPECT_DOUBLE_EQ(LoopWidthMm(mesh, loops[0]), 1);
}

TEST(BorderLoopsTest, OpeningsThatMeetInAVertexAreTwoLoops) {
  // The triangles 0 and 4 of the upper half meet in the top.
  const auto loops = BorderLoops(Octahedron({0, 4}));
  ASSERT_EQ(loops.size(), 2);
  EXPECT_EQ(loops[0].size(), 3);
  EXPECT_EQ(loops[1].size(), 3);
}

TEST(BorderLoopsTest, ClosingGivesAClosedOutwardSurface) {
  for (const std::vector<int>& left_out : {std::vector<int>{0}, {0, 4}, {1, 3, 5, 7}}) {
    const TriangleMesh mesh = Octahedron(left_out);
    const TriangleMesh closed = WithOpeningsClosed(mesh, BorderLoops(mesh));
    const SurfaceReport report = ValidateTriangleMesh(closed);
    EXPECT_TRUE(report.is_closed());
    EXPECT_GT(report.enclosed_volume_mm3, 0);
  }
}

}  // namespace
}  // namespace tissueform
