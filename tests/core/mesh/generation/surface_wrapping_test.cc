// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/generation/surface_wrapping.h"

#include <limits>
#include <numbers>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mesh/generation/surface_defects.h"
#include "core/mesh/surface_validation.h"
#include "tests/core/mesh/generation/surfaces.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using testing::BoxSurface;
using ::testing::HasSubstr;
using testing::SphereSurface;
using testing::Together;
using testing::WithHole;

WrappedSurface Wrap(const TriangleMesh& surface, double offset_mm) {
  WrappingOptions options;
  options.offset_mm = offset_mm;
  absl::StatusOr<WrappedSurface> wrapped = WrapSurface(surface, options);
  EXPECT_TRUE(wrapped.ok()) << wrapped.status();
  return *std::move(wrapped);
}

// What every wrap promises, by the checks that `mesh generate` makes and that know no CGAL wrap.
void ExpectSound(const WrappedSurface& wrapped, double offset_mm) {
  const SurfaceDefects defects = FindSurfaceDefects(wrapped.mesh);
  EXPECT_TRUE(defects.can_be_meshed()) << CheckMeshable(defects);
  EXPECT_EQ(defects.num_intersecting_pairs, 0);
  EXPECT_GT(defects.report.enclosed_volume_mm3, 0);
  EXPECT_LE(wrapped.largest_to_surface_mm, (1 + kAlphaPerOffset) * offset_mm);
}

std::string Refusal(const TriangleMesh& surface, double offset_mm) {
  WrappingOptions options;
  options.offset_mm = offset_mm;
  const absl::StatusOr<WrappedSurface> wrapped = WrapSurface(surface, options);
  EXPECT_FALSE(wrapped.ok());
  return std::string(wrapped.status().message());
}

TEST(SurfaceWrappingTest, SphereKeepsItsDistanceAndVolume) {
  const WrappedSurface wrapped = Wrap(SphereSurface({1, 2, 3}, 20, 12), 0.5);
  ExpectSound(wrapped, 0.5);
  EXPECT_NEAR(wrapped.largest_to_surface_mm, 0.5, 0.05);
  EXPECT_LE(wrapped.largest_from_surface_mm, 0.6);
  EXPECT_EQ(wrapped.covered_fraction, 0);
  const double ball = 4.0 / 3 * std::numbers::pi * 20.5 * 20.5 * 20.5;
  EXPECT_NEAR(wrapped.volume_mm3, ball, 0.02 * ball);
  EXPECT_FALSE(wrapped.is_sheet);
}

TEST(SurfaceWrappingTest, BridgesASmallHole) {
  const TriangleMesh holed = WithHole(SphereSurface({0, 0, 0}, 20, 12));
  EXPECT_LT(OffsetThatBridges(holed), 0.7);
  const WrappedSurface wrapped = Wrap(holed, 0.7);
  ExpectSound(wrapped, 0.7);
  EXPECT_GT(wrapped.volume_mm3, 33000);
  EXPECT_FALSE(wrapped.is_sheet);
}

TEST(SurfaceWrappingTest, AWideOpeningGivesASheetAndIsReported) {
  const WrappedSurface wrapped = Wrap(WithHole(BoxSurface({0, 0, 0}, {20, 20, 20})), 0.5);
  ExpectSound(wrapped, 0.5);
  EXPECT_TRUE(wrapped.is_sheet);
}

TEST(SurfaceWrappingTest, OverlappingBoxesBecomeOneSurface) {
  const TriangleMesh boxes =
      Together(BoxSurface({0, 0, 0}, {20, 20, 20}, 4), BoxSurface({11, 12, 13}, {31, 32, 33}, 3));
  ASSERT_FALSE(FindSurfaceDefects(boxes).can_be_meshed());
  const WrappedSurface wrapped = Wrap(boxes, 0.4);
  ExpectSound(wrapped, 0.4);
  EXPECT_EQ(ValidateTriangleMesh(wrapped.mesh).num_components, 1);
  EXPECT_GT(wrapped.covered_fraction, 0.05);
  EXPECT_GT(wrapped.volume_mm3, 16000 - 9 * 8 * 7);
  EXPECT_LT(wrapped.volume_mm3, 16000 - 9 * 8 * 7 + 0.5 * 4900);
}

TEST(SurfaceWrappingTest, SameBytesEveryTime) {
  const TriangleMesh sphere = WithHole(SphereSurface({0, 0, 0}, 10, 6));
  const WrappedSurface a = Wrap(sphere, 0.5);
  const WrappedSurface b = Wrap(sphere, 0.5);
  EXPECT_EQ(a.mesh.positions(), b.mesh.positions());
  EXPECT_EQ(a.mesh.triangles(), b.mesh.triangles());
}

TEST(SurfaceWrappingTest, EstimateIsWithinAFactorOfTwo) {
  for (const double offset_mm : {0.3, 1.0}) {
    const TriangleMesh sphere = SphereSurface({0, 0, 0}, 25, 16);
    const double estimate =
        EstimatedWrapTriangles(ValidateTriangleMesh(sphere).area_mm2, offset_mm);
    const auto made = static_cast<double>(Wrap(sphere, offset_mm).mesh.num_triangles());
    EXPECT_LT(made, 2 * estimate);
    EXPECT_GT(made, estimate / 2);
  }
}

TEST(SurfaceWrappingTest, RefusesWithAReason) {
  const TriangleMesh sphere = SphereSurface({0, 0, 0}, 100, 8);
  EXPECT_THAT(Refusal(sphere, 0), HasSubstr("positive length"));
  EXPECT_THAT(Refusal(sphere, 0.01), HasSubstr("use an offset of"));

  Positions positions = sphere.positions();
  positions(3, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(Refusal(*TriangleMesh::Create(positions, sphere.triangles()), 1),
              HasSubstr("1 vertices have coordinates that are not finite"));

  positions.setOnes();
  EXPECT_THAT(Refusal(*TriangleMesh::Create(positions, sphere.triangles()), 1),
              HasSubstr("no triangle has an area"));
}

}  // namespace
}  // namespace tissueform
