// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/surface_extraction.h"

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <random>

#include "core/mesh/surface_validation.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;
using ::testing::HasSubstr;
using tissueform::testing::StatusIs;

using Height = std::function<double(const Vector3d&)>;

// A grid of 40 x 40 x 40 voxels of 0.5 mm round the origin.
VoxelGrid<float> Sampled(const Height& height) {
  VoxelGrid<float> grid(GridGeometry{
      .size = {40, 40, 40}, .origin_mm = Vector3d(-9.75, -9.75, -9.75), .spacing_mm = 0.5});
  for (int z = 0; z < 40; ++z) {
    for (int y = 0; y < 40; ++y) {
      for (int x = 0; x < 40; ++x) {
        grid.At(x, y, z) = static_cast<float>(height(grid.geometry.Centre(x, y, z)));
      }
    }
  }
  return grid;
}

Height Ball(const Vector3d& centre, double radius_mm) {
  return [=](const Vector3d& p) { return radius_mm - (p - centre).norm(); };
}

Height Either(const Height& a, const Height& b) {
  return [=](const Vector3d& p) { return std::max(a(p), b(p)); };
}

Height Without(const Height& a, const Height& b) {
  return [=](const Vector3d& p) { return std::min(a(p), -b(p)); };
}

double BallVolume(double radius_mm) { return 4.0 / 3 * std::numbers::pi * std::pow(radius_mm, 3); }

void ExpectClosed(const SurfaceReport& report) {
  EXPECT_TRUE(report.is_closed());
  EXPECT_TRUE(report.usable());
  EXPECT_EQ(report.Find("duplicate_vertices"), nullptr);
}

TEST(SurfaceExtractionTest, BallHasItsRadiusAndVolumeAndFacesOutwards) {
  const Vector3d centre(0.2, -0.3, 0.1);
  ASSERT_OK_AND_ASSIGN(const TriangleMesh surface, ExtractSurface(Sampled(Ball(centre, 7))));
  const SurfaceReport report = ValidateTriangleMesh(surface);
  ExpectClosed(report);
  EXPECT_EQ(report.euler_characteristic, 2);
  EXPECT_NEAR(report.enclosed_volume_mm3, BallVolume(7), 0.01 * BallVolume(7));
  for (const auto& p : surface.positions().rowwise()) {
    EXPECT_NEAR((p.transpose() - centre).norm(), 7, 0.01);
  }
}

TEST(SurfaceExtractionTest, LevelIsWhereTheSurfaceRuns) {
  SurfaceExtractionOptions options;
  options.level = 2;
  ASSERT_OK_AND_ASSIGN(const TriangleMesh surface,
                       ExtractSurface(Sampled(Ball(Vector3d::Zero(), 7)), options));
  EXPECT_NEAR(surface.positions().rowwise().norm().mean(), 5, 0.01);
}

TEST(SurfaceExtractionTest, InsideThatReachesTheBorderIsClosedHalfAVoxelOutside) {
  ASSERT_OK_AND_ASSIGN(const TriangleMesh surface,
                       ExtractSurface(Sampled([](const Vector3d& p) { return p.x() + 3; })));
  const SurfaceReport report = ValidateTriangleMesh(surface);
  ExpectClosed(report);
  EXPECT_NEAR(surface.positions().col(0).minCoeff(), -3, 1e-5);
  EXPECT_NEAR(surface.positions().col(0).maxCoeff(), 10, 1e-5);
  EXPECT_NEAR(surface.positions().col(2).maxCoeff(), 10, 1e-5);
  EXPECT_NEAR(report.enclosed_volume_mm3, 13 * 20 * 20, 0.01 * 13 * 20 * 20);
}

TEST(SurfaceExtractionTest, OnlyTheLargestPartIsKept) {
  const Height two = Either(Ball({-4, 0, 0}, 4.5), Ball({6, 0, 0}, 2));
  ASSERT_OK_AND_ASSIGN(const TriangleMesh surface, ExtractSurface(Sampled(two)));
  EXPECT_LT(surface.positions().col(0).maxCoeff(), 1);
  EXPECT_EQ(ValidateTriangleMesh(surface).num_components, 1);
}

TEST(SurfaceExtractionTest, LargeEnoughPartsAreKeptWhenAskedFor) {
  SurfaceExtractionOptions options;
  options.min_part_volume_mm3 = 30;  // one of the small balls has 34 mm3, the other 14
  const Height balls =
      Either(Ball({-5, 0, 0}, 3), Either(Ball({5, 0, 0}, 2), Ball({5, 6, 0}, 1.5)));
  ASSERT_OK_AND_ASSIGN(const TriangleMesh surface, ExtractSurface(Sampled(balls), options));
  const SurfaceReport report = ValidateTriangleMesh(surface);
  ExpectClosed(report);
  const double expected = BallVolume(3) + BallVolume(2);
  EXPECT_NEAR(report.enclosed_volume_mm3, expected, 0.03 * expected);
}

TEST(SurfaceExtractionTest, LargeCavitiesStayAndSmallOnesAreFilled) {
  const Height ball =
      Without(Without(Ball(Vector3d::Zero(), 9), Ball({-4, 0, 0}, 3)), Ball({4, 0, 0}, 1.5));
  SurfaceExtractionOptions options;
  options.min_cavity_volume_mm3 = 50;
  ASSERT_OK_AND_ASSIGN(const TriangleMesh surface, ExtractSurface(Sampled(ball), options));
  const SurfaceReport report = ValidateTriangleMesh(surface);
  EXPECT_EQ(report.num_components, 2);
  EXPECT_NEAR(report.enclosed_volume_mm3, BallVolume(9) - BallVolume(3), 0.01 * BallVolume(9));
  ASSERT_OK_AND_ASSIGN(const TriangleMesh all, ExtractSurface(Sampled(ball)));
  EXPECT_EQ(ValidateTriangleMesh(all).num_components, 3);
}

TEST(SurfaceExtractionTest, PartsThatFloatInACavityAndCavitiesOfOtherPartsAreLeftOut) {
  const Height shell = Without(Ball({-2, 0, 0}, 7), Ball({-2, 0, 0}, 5));
  const Height floating = Without(Ball({-2, 0, 0}, 3), Ball({-2, 0, 0}, 1.5));
  const Height beside = Without(Ball({7.5, 0, 0}, 2), Ball({7.5, 0, 0}, 1));
  ASSERT_OK_AND_ASSIGN(const TriangleMesh surface,
                       ExtractSurface(Sampled(Either(shell, Either(floating, beside)))));
  const SurfaceReport report = ValidateTriangleMesh(surface);
  // The shell and its own wall.
  EXPECT_EQ(report.num_components, 2);
  EXPECT_NEAR(report.enclosed_volume_mm3, BallVolume(7) - BallVolume(5), 0.02 * BallVolume(7));
}

TEST(SurfaceExtractionTest, ValuesAtTheLevelLeaveNoTriangleWithoutArea) {
  // Whole numbers, as of a mask that was smoothed too little: many are exactly at the level.
  std::mt19937 generator(3);
  VoxelGrid<float> grid = Sampled(Ball(Vector3d::Zero(), 8));
  for (float& value : grid.values) {
    if (std::abs(value) < 2) value = static_cast<float>(generator() % 3) - 1;
  }
  SurfaceExtractionOptions options;
  options.clearance = 0.05F;
  ASSERT_OK_AND_ASSIGN(const TriangleMesh surface, ExtractSurface(grid, options));
  EXPECT_EQ(ValidateTriangleMesh(surface).Find("degenerate_triangles"), nullptr);
  EXPECT_EQ(ValidateTriangleMesh(surface).Find("open_edges"), nullptr);
}

TEST(SurfaceExtractionTest, SameGridGivesTheSameSurface) {
  const VoxelGrid<float> grid = Sampled(Ball({1, 2, 0}, 6));
  ASSERT_OK_AND_ASSIGN(const TriangleMesh first, ExtractSurface(grid));
  ASSERT_OK_AND_ASSIGN(const TriangleMesh second, ExtractSurface(grid));
  EXPECT_EQ(first.positions(), second.positions());
  EXPECT_EQ(first.triangles(), second.triangles());
}

TEST(SurfaceExtractionTest, GridsWithoutASurfaceAreRefused) {
  VoxelGrid<float> grid = Sampled([](const Vector3d& /*p*/) { return -1; });
  EXPECT_THAT(ExtractSurface(grid),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no voxel")));
  grid.values[7] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(ExtractSurface(grid),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("not finite")));
  grid.values.pop_back();
  EXPECT_THAT(ExtractSurface(grid),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("disagree")));
}

}  // namespace
}  // namespace tissueform
