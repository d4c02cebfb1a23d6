// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/surface_cut.h"

#include "gtest/gtest.h"

#include "core/mesh/surface_validation.h"
#include "core/mesh/tet_topology.h"
#include "tests/testing/meshes.h"

namespace tissueform {
namespace {

using Eigen::Index;

// The boundary of a bar of 20 by 20 by 40 mm.
class SurfaceCutTest : public ::testing::Test {
 protected:
  SurfaceCutTest() {
    const TetMesh bar = testing::Bar({2, 2, 4}, 10);
    surface_ = *TriangleMesh::Create(bar.positions(), BoundaryFacets(bar));
  }
  TriangleMesh surface_ =
      *TriangleMesh::Create(Positions::Identity(3, 3), TriangleIndices{{0, 1, 2}});
};

TEST_F(SurfaceCutTest, EveryTriangleLiesOnOneSideAndTheShapeStays) {
  const Eigen::Vector3d normal = Eigen::Vector3d(0.3, -0.2, 1).normalized();
  const auto heights = [&](const Positions& p) {
    return Eigen::VectorXd((p * normal).array() - 17.3);
  };
  const TriangleMesh cut = CutWhereZero(surface_, heights(surface_.positions()));
  const Eigen::VectorXd after = heights(cut.positions());
  for (const auto& triangle : cut.triangles().rowwise()) {
    const double low = std::min({after[triangle[0]], after[triangle[1]], after[triangle[2]]});
    const double high = std::max({after[triangle[0]], after[triangle[1]], after[triangle[2]]});
    EXPECT_TRUE(low > -0.5 || high < 0.5);  // nearer to a corner than a fiftieth it is not cut
  }
  EXPECT_GT(cut.num_triangles(), surface_.num_triangles());
  const SurfaceReport report = ValidateTriangleMesh(cut);
  EXPECT_TRUE(report.is_closed());
  EXPECT_NEAR(report.enclosed_volume_mm3, 16'000, 1e-9);
  EXPECT_NEAR(report.area_mm2, 4000, 1e-9);
}

TEST_F(SurfaceCutTest, OnOneSideNothingIsCut) {
  for (const double height : {-1.0, 1.0, 0.0}) {
    const TriangleMesh same =
        CutWhereZero(surface_, Eigen::VectorXd::Constant(surface_.num_vertices(), height));
    EXPECT_EQ(same.positions(), surface_.positions());
    EXPECT_EQ(same.triangles(), surface_.triangles());
  }
}

}  // namespace
}  // namespace tissueform
