// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// What metal does to a plan when its streaks are reduced: the bundled head as a scanner shows it
// without metal, with fillings and with braces (tests/testing/metal_phantom.h). The tests share one
// build each, so the whole program is one test of ctest.

#include <filesystem>
#include <memory>
#include <string>
#include <unistd.h>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/bone_parts.h"
#include "core/imaging/anatomy/head_segmentation.h"
#include "core/imaging/anatomy/landmarks.h"
#include "core/imaging/metal/metal_reduction.h"
#include "core/mechanics/linear_solvers/blas_threads.h"
#include "tests/core/planning/plan_building/plan_comparison.h"
#include "tests/testing/metal_phantom.h"
#include "tests/testing/nrrd_file.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

constexpr int kThreads = 2;

// What a correction must reach.
constexpr double kSegmentMeanMm = 0.8;
constexpr double kSegmentP95Mm = 2.5;
constexpr double kLandmarkMm = 2;
constexpr double kCovered = 0.99;
constexpr double kMovementMeanMm = 0.3;
constexpr double kMovementMm = 1;

absl::StatusOr<PlanBuild> BuildFrom(const CtVolume& ct) {
  const std::string path = absl::StrCat(::testing::TempDir(), "metal_plan_", getpid(), ".nrrd");
  TF_RETURN_IF_ERROR(WriteNrrd(path, ct));
  absl::StatusOr<PlanBuild> build =
      BuildPlan(path, MetalRecipe(true), {.threads = kThreads, .on_stage = {}});
  std::filesystem::remove(path);
  return build;
}

// As BuildPlan finds them with the key `metal` "off", without the minute that the rest takes.
absl::StatusOr<Landmarks> LandmarksWithoutCorrection(const CtVolume& ct) {
  const Recipe recipe = MetalRecipe(false);
  TF_ASSIGN_OR_RETURN(const CtWithMetal resampled,
                      ResampleWithoutStreaks(ct, recipe.spacing_mm, recipe.metal, kThreads));
  TF_ASSIGN_OR_RETURN(const HeadSegmentation head,
                      SegmentHead(resampled.hu, recipe.segmentation, nullptr, resampled.metal));
  TF_ASSIGN_OR_RETURN(const BoneParts parts, SeparateBoneParts(head));
  return FindLandmarks(head, parts);
}

struct Built {
  std::unique_ptr<PlanBuild> free;
  PlanDifference fillings;
  PlanDifference braces;
  WorstAt landmark_of_uncorrected_fillings;
};

class MetalPlanTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    SetBlasThreads(1);
    const absl::Status made = Make();
    ASSERT_TRUE(made.ok()) << made;
  }
  static void TearDownTestSuite() { shared_build.reset(); }

  static absl::Status Make() {
    TF_ASSIGN_OR_RETURN(const SimulatedHeads heads, SimulateHeads(kThreads));
    auto built = std::make_unique<Built>();
    TF_ASSIGN_OR_RETURN(PlanBuild free, BuildFrom(heads.free));
    for (const auto& [head, difference] :
         {std::pair(&heads.fillings, &built->fillings), std::pair(&heads.braces, &built->braces)}) {
      TF_ASSIGN_OR_RETURN(const PlanBuild build, BuildFrom(*head));
      TF_ASSIGN_OR_RETURN(*difference, ComparePlans(build, free, DeformationModel::kLinearElastic));
    }
    TF_ASSIGN_OR_RETURN(const Landmarks uncorrected, LandmarksWithoutCorrection(heads.fillings));
    built->landmark_of_uncorrected_fillings = WorstLandmark(uncorrected, free.landmarks);
    built->free = std::make_unique<PlanBuild>(std::move(free));
    shared_build = std::move(built);
    return absl::OkStatus();
  }

  void SetUp() override { ASSERT_NE(shared_build, nullptr); }

  static std::unique_ptr<Built> shared_build;
};

std::unique_ptr<Built> MetalPlanTest::shared_build;

TEST_F(MetalPlanTest, APlanIsEqualToItself) {
  ASSERT_OK_AND_ASSIGN(
      const PlanDifference none,
      ComparePlans(*shared_build->free, *shared_build->free, DeformationModel::kLinearElastic));
  EXPECT_EQ(none.segment_p95_mm, 0);
  EXPECT_EQ(none.landmark.mm, 0);
  EXPECT_EQ(none.bone_near_skin, 0);
  EXPECT_LT(none.movement.mm, 1e-9);
}

void ExpectAsWithoutMetal(const PlanDifference& corrected) {
  SCOPED_TRACE(TableRow("corrected", corrected));
  EXPECT_LE(corrected.segment_mean_mm, kSegmentMeanMm);
  EXPECT_LE(corrected.segment_p95_mm, kSegmentP95Mm);
  EXPECT_LE(corrected.landmark.mm, kLandmarkMm);
  EXPECT_EQ(corrected.bone_near_skin, 0);
  EXPECT_GE(corrected.least_covered, kCovered);
  EXPECT_LE(corrected.movement_mean_mm, kMovementMeanMm);
  EXPECT_LE(corrected.movement.mm, kMovementMm);
}

TEST_F(MetalPlanTest, WithFillingsCorrectedThePlanIsAsWithoutMetal) {
  ExpectAsWithoutMetal(shared_build->fillings);
}

TEST_F(MetalPlanTest, WithBracesCorrectedThePlanIsAsWithoutMetal) {
  ExpectAsWithoutMetal(shared_build->braces);
  // The brackets count as their teeth, and the nearest has 3.2 mm of lip over it; the tolerance
  // allows for its blur, which is finer than a voxel.
  EXPECT_GE(shared_build->braces.nearest_bone.mm, kNearSkinMm - 0.5);
}

TEST_F(MetalPlanTest, WithoutCorrectionFillingsMisleadALandmark) {
  const WorstAt& spoilt = shared_build->landmark_of_uncorrected_fillings;
  EXPECT_GT(spoilt.mm, 5 * kLandmarkMm) << spoilt.name;
  EXPECT_LT(shared_build->fillings.landmark.mm, spoilt.mm / 5);
}

}  // namespace
}  // namespace tissueform::testing
