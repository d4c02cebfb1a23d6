// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/bar_mesh.h"

#include <limits>

#include "core/mesh/tet_quality.h"
#include "core/mesh/tet_topology.h"
#include "core/mesh/validation.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::IsOk;
using testing::StatusIs;

using ::tissueform::testing::kInvalid;

TEST(BarMeshTest, BarsOfTheSourcesTableHaveItsCounts) {
  const struct {
    std::array<int, 3> cells;
    Eigen::Index vertices, tets;
  } bars[] = {{{10, 10, 20}, 2541, 12000},
              {{10, 10, 60}, 7381, 36000},
              {{15, 25, 30}, 12896, 67500},
              {{20, 20, 50}, 22491, 120000},
              {{25, 25, 50}, 34476, 187500}};
  for (const auto& bar : bars) {
    ASSERT_OK_AND_ASSIGN(const TetMesh mesh, BarMesh(CubeGrid(bar.cells, 1)));
    EXPECT_EQ(mesh.num_vertices(), bar.vertices);
    EXPECT_EQ(mesh.num_tets(), bar.tets);
  }
}

TEST(BarMeshTest, GradedGridFillsItsBoxWithMatchingPositiveTets) {
  const GridPlanes planes{{-1, 0, 0.5}, {2, 3}, {0, 0.25, 0.5, 1.5, 4}};
  ASSERT_OK_AND_ASSIGN(const TetMesh mesh, BarMesh(planes));
  const MeshReport report = ValidateTetMesh(mesh);
  EXPECT_THAT(CheckUsable(report), IsOk());
  EXPECT_TRUE(report.defects.empty());
  EXPECT_GT(report.quality.min_volume_mm3, 0);
  EXPECT_NEAR(report.quality.total_volume_mm3, 1.5 * 1 * 4, 1e-12);
  // Two triangles a cell on each side of the box, none inside.
  EXPECT_EQ(BoundaryFacets(mesh).rows(), 2 * 2 * (2 * 1 + 1 * 4 + 4 * 2));
}

TEST(BarMeshTest, VerticesAreNumberedAlongXThenYThenZ) {
  const GridPlanes planes{{0, 1, 3}, {0, 2}, {5, 6, 8}};
  ASSERT_OK_AND_ASSIGN(const TetMesh mesh, BarMesh(planes));
  EXPECT_EQ(mesh.positions().row(2 + 3 * (1 + 2 * 2)), Eigen::RowVector3d(3, 2, 8));
}

TEST(BarMeshTest, EvenPlanesMeetBothEndsExactly) {
  const std::vector<double> planes = EvenPlanes(0.1, 0.7, 3);
  ASSERT_EQ(planes.size(), 4U);
  EXPECT_EQ(planes.front(), 0.1);
  EXPECT_EQ(planes.back(), 0.7);
  EXPECT_NEAR(planes[1], 0.3, 1e-15);
}

TEST(BarMeshTest, PlanesThatDoNotRiseAreRefused) {
  EXPECT_THAT(BarMesh({{0, 1}, {0, 1, 1}, {0, 1}}),
              StatusIs(kInvalid, HasSubstr("plane 2 across y")));
  EXPECT_THAT(BarMesh({{0, 1}, {0, 1}, {0, std::numeric_limits<double>::quiet_NaN()}}),
              StatusIs(kInvalid, HasSubstr("plane 1 across z")));
  EXPECT_THAT(BarMesh({{0}, {0, 1}, {0, 1}}), StatusIs(kInvalid, HasSubstr("1 planes across x")));
}

TEST(BarMeshTest, MoreVerticesThanAnIndexCanNameAreRefused) {
  const std::vector<double> many = EvenPlanes(0, 1, 1300);
  EXPECT_THAT(BarMesh({many, many, many}), StatusIs(kInvalid, HasSubstr("take fewer planes")));
}

}  // namespace
}  // namespace tissueform
