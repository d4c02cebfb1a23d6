// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/grid_operations.h"
#include "core/imaging/ct/isotropic_resample.h"
#include "core/mechanics/linear_solvers/blas_threads.h"
#include "core/mesh/skin_region.h"
#include "core/planning/plan_building/plan_builder.h"
#include "tests/testing/metal_phantom.h"
#include "tests/testing/nrrd_file.h"
#include "tests/testing/status_matchers.h"

// A whole head in coarse slices, with fillings in two bands of slices whose streaks tear lips and
// cheeks.
namespace tissueform::testing {
namespace {

constexpr int kThreads = 2;

// The bundled head in voxels of 1 x 1 x 2 mm.
absl::StatusOr<CtVolume> CoarseSlices() {
  TF_ASSIGN_OR_RETURN(const CtVolume fine, FineHead());
  TF_ASSIGN_OR_RETURN(const HuGrid grid, ResampleIsotropic(fine, 1, {.threads = kThreads}));
  CtVolume volume;
  volume.size = {grid.geometry.size[0], grid.geometry.size[1], grid.geometry.size[2] / 2};
  volume.spacing_mm = {1, 1, 2};
  volume.origin_mm = grid.geometry.origin_mm + Eigen::Vector3d(0, 0, 0.5);
  for (int k = 0; k < volume.size[2]; ++k) {
    for (int j = 0; j < volume.size[1]; ++j) {
      for (int i = 0; i < volume.size[0]; ++i) {
        volume.hu.push_back(
            static_cast<int16_t>((grid.At(i, j, 2 * k) + grid.At(i, j, 2 * k + 1)) / 2));
      }
    }
  }
  return volume;
}

// A wedge of a slice that begins at a filling.
struct Streak {
  Eigen::Vector2d from;
  Eigen::Vector2d along;
  double half_width_mm;
  double hu;

  double At(const Eigen::Vector2d& place) const {
    const Eigen::Vector2d off = place - from;
    const double way = off.dot(along);
    const double beside = std::abs(along.x() * off.y() - along.y() * off.x());
    return way > 0 && beside < half_width_mm ? hu * std::exp(-way / 80) : 0;
  }
};

void PutStreaks(const MetalWork& work, uint32_t seed, CtVolume* volume) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> angle(0, 2 * 3.14159265358979);
  std::uniform_real_distribution<double> half_width_mm(1, 2.5);
  const size_t pixels = static_cast<size_t>(volume->size[0]) * static_cast<size_t>(volume->size[1]);
  for (int k = 0; k < volume->size[2]; ++k) {
    std::vector<Streak> streaks;
    for (const MetalPart& part : work.parts) {
      const double off_mm = std::abs(volume->Place(0, 0, k).z() - part.centre_mm.z());
      if (off_mm > part.half_mm.z() + 1) continue;
      for (int s = 0; s < 6; ++s) {
        const double to = angle(random);
        streaks.push_back({part.centre_mm.head<2>(),
                           {std::cos(to), std::sin(to)},
                           half_width_mm(random),
                           s % 2 == 0 ? -1800.0 : 1500.0});
      }
    }
    for (size_t pixel = 0; pixel < pixels && !streaks.empty(); ++pixel) {
      const Eigen::Vector3d place = volume->Place(static_cast<int>(pixel) % volume->size[0],
                                                  static_cast<int>(pixel) / volume->size[0], k);
      const bool metal = std::any_of(work.parts.begin(), work.parts.end(),
                                     [&](const MetalPart& part) { return part.Contains(place); });
      int16_t& hu = volume->hu[pixel + pixels * static_cast<size_t>(k)];
      double value = hu;
      for (const Streak& streak : streaks) value += streak.At(place.head<2>());
      hu = static_cast<int16_t>(metal ? 4000.0 : std::clamp(value, -1024.0, 2400.0));
    }
  }
}

absl::StatusOr<PlanBuild> BuildTorn() {
  TF_ASSIGN_OR_RETURN(CtVolume head, CoarseSlices());
  PutStreaks(Fillings(), 1, &head);
  const std::string path = absl::StrCat(::testing::TempDir(), "/torn.nrrd");
  TF_RETURN_IF_ERROR(WriteNrrd(path, head));
  Recipe recipe;
  RecipeSegment mandible;
  mandible.name = "mandible";
  mandible.pose.translation_mm.y() = -6;
  recipe.segments = {mandible};
  return BuildPlan(path, recipe, {kThreads, nullptr});
}

TEST(TornSkinTest, SkinIsCarriedOverAndCoversTheFace) {
  SetBlasThreads(1);
  ASSERT_OK_AND_ASSIGN(const PlanBuild build, BuildTorn());
  EXPECT_GE(build.coverage.whole.share(), 0.995);
  for (const SkinRegion region : kNamedSkinRegions) {
    EXPECT_GE(build.coverage.regions[static_cast<size_t>(region)].share(), 0.995)
        << SkinRegionName(region);
  }
  EXPECT_TRUE(build.coverage.holes.empty());
  EXPECT_GT(build.metal.carried.slices, 5);
  EXPECT_GT(build.metal.carried.filled_mm3, 1000);
  EXPECT_GT(build.metal.carried.removed_mm3, 1000);
  ASSERT_FALSE(build.carried_skin.values.empty());
  EXPECT_GT(CountVoxels(build.carried_skin), 500);
}

}  // namespace
}  // namespace tissueform::testing
