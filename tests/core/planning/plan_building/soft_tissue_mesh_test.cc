// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/soft_tissue_mesh.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <string>

#include "core/mesh/generation/surface_defects.h"
#include "core/mesh/tet_topology.h"
#include "core/mesh/validation.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/triangle_corners.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using tissueform::testing::Corners;
using tissueform::testing::IsOk;
using tissueform::testing::StatusIs;

using Height = std::function<double(const Vector3d&)>;

// 44 x 44 x 44 voxels of 1 mm round the origin.
VoxelGrid<float> Sampled(const Height& height) {
  VoxelGrid<float> grid(
      GridGeometry{.size = {44, 44, 44}, .origin_mm = Vector3d::Constant(-21.5), .spacing_mm = 1});
  for (int z = 0; z < 44; ++z) {
    for (int y = 0; y < 44; ++y) {
      for (int x = 0; x < 44; ++x) {
        grid.At(x, y, z) = static_cast<float>(height(grid.geometry.Centre(x, y, z)));
      }
    }
  }
  return grid;
}

// A ball of 18 mm round a cavity of 8 mm.
double Shell(const Vector3d& p) {
  return std::min(18 - p.norm(), (p - Vector3d(3, 0, 0)).norm() - 8);
}

double ShellVolume() { return 4.0 / 3 * std::numbers::pi * (std::pow(18.0, 3) - std::pow(8.0, 3)); }

// A ball that tunnels run through in all directions, with thin walls between: part of a gyroid.
double Sponge(const Vector3d& p) {
  const Vector3d q = p / 3.5;
  const double gyroid = std::sin(q.x()) * std::cos(q.y()) + std::sin(q.y()) * std::cos(q.z()) +
                        std::sin(q.z()) * std::cos(q.x());
  return std::min(19 - p.norm(), 2.5 * (gyroid + 0.4));
}

// What every mesh of soft tissue has to reach.
void ExpectGoodMesh(const SoftTissueMesh& made, double spacing_mm) {
  const MeshReport report = ValidateTetMesh(made.mesh);
  EXPECT_TRUE(report.usable());
  EXPECT_EQ(report.num_components, 1);
  EXPECT_GT(report.quality.min_volume_mm3, 0);
  EXPECT_LE(made.report.tets_below_3_deg, made.mesh.num_tets() / 1000);
  EXPECT_NEAR(made.report.volume_ratio, 1, 0.03);
  EXPECT_LT(made.report.to_isosurface.mean_mm, 0.6 * spacing_mm);
  EXPECT_LT(made.report.to_isosurface.p99_mm, 2 * spacing_mm);
  EXPECT_LT(made.report.from_isosurface.mean_mm, 0.6 * spacing_mm);
  EXPECT_LT(made.report.from_isosurface.p99_mm, 2 * spacing_mm);
  EXPECT_THAT(CheckMeshable(FindSurfaceDefects(made.surface)), IsOk());
}

TEST(SoftTissueMeshTest, ShellIsFilledRoundItsCavity) {
  ASSERT_OK_AND_ASSIGN(const SoftTissueMesh made, MeshSoftTissue(Sampled(Shell)));
  ExpectGoodMesh(made, 1);
  EXPECT_NEAR(made.report.quality.total_volume_mm3, ShellVolume(), 0.03 * ShellVolume());
  EXPECT_EQ(made.report.cavities, 1);
  EXPECT_EQ(made.report.attempts, 1);
  EXPECT_EQ(made.report.edge_mm, 4);
}

TEST(SoftTissueMeshTest, SurfaceIsTheBoundaryVertexByVertex) {
  ASSERT_OK_AND_ASSIGN(const SoftTissueMesh made, MeshSoftTissue(Sampled(Shell)));
  EXPECT_EQ(made.mesh.positions().topRows(made.surface.num_vertices()), made.surface.positions());
  EXPECT_EQ(Corners(BoundaryFacets(made.mesh)), Corners(made.surface.triangles()));
}

TEST(SoftTissueMeshTest, SpongeWithThinWallsIsMeshed) {
  SoftTissueMeshOptions options;
  options.edge_mm = 3;
  ASSERT_OK_AND_ASSIGN(const SoftTissueMesh made, MeshSoftTissue(Sampled(Sponge), options));
  ExpectGoodMesh(made, 1);
  EXPECT_LT(ValidateTriangleMesh(made.surface).euler_characteristic, -10);
}

TEST(SoftTissueMeshTest, FineRegionHasMoreVertices) {
  SoftTissueMeshOptions options;
  options.fine_regions = {{Vector3d(0, -18, 0), 6, 1.5}};
  ASSERT_OK_AND_ASSIGN(const SoftTissueMesh made, MeshSoftTissue(Sampled(Shell), options));
  ExpectGoodMesh(made, 1);
  const auto y = made.surface.positions().col(1).array();
  EXPECT_GT((y < -15).count(), 3 * (y > 15).count());
}

TEST(SoftTissueMeshTest, SameGridGivesTheSameMesh) {
  ASSERT_OK_AND_ASSIGN(const SoftTissueMesh first, MeshSoftTissue(Sampled(Shell)));
  ASSERT_OK_AND_ASSIGN(const SoftTissueMesh second, MeshSoftTissue(Sampled(Shell)));
  EXPECT_EQ(first.mesh.positions(), second.mesh.positions());
  EXPECT_EQ(first.mesh.tets(), second.mesh.tets());
}

TEST(SoftTissueMeshTest, StagesAreAnnouncedAndMayEndTheWork) {
  std::vector<std::string> stages;
  SoftTissueMeshOptions options;
  options.on_stage = [&](absl::string_view stage) {
    stages.emplace_back(stage);
    return stages.size() < 3 ? absl::OkStatus() : absl::CancelledError("enough");
  };
  EXPECT_THAT(MeshSoftTissue(Sampled(Shell), options),
              StatusIs(absl::StatusCode::kCancelled, "enough"));
  EXPECT_THAT(stages, ElementsAre("surface of the soft tissue", "remeshing the surface",
                                  "filling the surface with tets"));
}

TEST(SoftTissueMeshTest, AnyErrorOfTheCallerEndsTheWork) {
  int calls = 0;
  SoftTissueMeshOptions options;
  options.on_stage = [&](absl::string_view /*stage*/) {
    return ++calls < 2 ? absl::OkStatus() : absl::InvalidArgumentError("no more");
  };
  EXPECT_THAT(MeshSoftTissue(Sampled(Shell), options),
              StatusIs(absl::StatusCode::kInvalidArgument, "no more"));
  EXPECT_EQ(calls, 2);
}

TEST(SoftTissueMeshTest, LimitsHoldAndAreNotRetried) {
  SoftTissueMeshOptions options;
  options.limits.max_memory_bytes = 1000;  // of the mesh that the child may send
  options.max_attempts = 2;
  EXPECT_THAT(MeshSoftTissue(Sampled(Shell), options),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("memory")));
}

TEST(SoftTissueMeshTest, GridWithoutTissueAndOptionsWithoutSenseAreRefused) {
  EXPECT_THAT(MeshSoftTissue(Sampled([](const Vector3d& /*p*/) { return -1; })),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no voxel")));
  SoftTissueMeshOptions options;
  options.retry_factor = 1.5;
  EXPECT_THAT(MeshSoftTissue(Sampled(Shell), options),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("retry factor")));
}

}  // namespace
}  // namespace tissueform
