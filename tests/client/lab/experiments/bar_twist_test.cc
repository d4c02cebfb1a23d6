// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/experiments/bar_twist.h"

#include "client/lab/experiments/guidance_experiment.h"
#include "client/lab/experiments/materials_experiment.h"
#include "core/mesh/bar_mesh.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

TwistProblem SmallBar(double angle_deg) {
  return {BarMesh(CubeGrid({4, 4, 24}, 1)).value(), {}, angle_deg, 1};
}

// Mean section ratio over the sections [begin, end).
double MeanSection(const TwistResult& result, size_t begin, size_t end) {
  double sum = 0;
  for (size_t s = begin; s < end; ++s) sum += result.section_ratios[s];
  return sum / static_cast<double>(end - begin);
}

TEST(BarTwistTest, WithoutTwistEverySectionAndTheVolumeAreAsAtRest) {
  ASSERT_OK_AND_ASSIGN(const TwistResult volume, TwistVolume(SmallBar(0)));
  ASSERT_OK_AND_ASSIGN(const TwistResult surface, TwistSurface(SmallBar(0)));
  for (const TwistResult* result : {&volume, &surface}) {
    EXPECT_NEAR(result->volume_ratio, 1, 1e-12);
    EXPECT_NEAR(result->SmallestSection(), 1, 1e-12);
    EXPECT_NEAR(result->LargestSection(), 1, 1e-12);
    EXPECT_EQ(result->inverted_tets, 0);
  }
}

// Fig. 1: the surface shrinks much more than the volume.
TEST(BarTwistTest, VolumeKeepsVolumeAndSectionsBetterThanSurface) {
  ASSERT_OK_AND_ASSIGN(const TwistResult volume, TwistVolume(SmallBar(360)));
  ASSERT_OK_AND_ASSIGN(const TwistResult surface, TwistSurface(SmallBar(360)));
  EXPECT_EQ(volume.inverted_tets, 0);
  EXPECT_LT(1 - volume.volume_ratio, 0.5 * (1 - surface.volume_ratio));
  EXPECT_GT(volume.SmallestSection(), surface.SmallestSection() + 0.2);
}

TEST(BarTwistTest, BarOfOneMaterialIsTurnedByHalfInTheMiddle) {
  ASSERT_OK_AND_ASSIGN(const TwistResult volume, TwistVolume(SmallBar(360)));
  EXPECT_NEAR(volume.turn_at_middle_deg, 180, 1);
}

// Fig. 5: a series of two springs; with stiffnesses 1 and 3 the soft half takes three quarters.
TEST(BarTwistTest, SoftHalfTakesTheLargerShareOfTheTwist) {
  ASSERT_OK_AND_ASSIGN(const TwistProblem problem, TwoMaterialBar({4, 4, 24}, 1));
  ASSERT_OK_AND_ASSIGN(const TwistResult volume, TwistVolume(problem));
  ASSERT_OK_AND_ASSIGN(const TwistResult surface, TwistSurface(problem));
  EXPECT_NEAR(volume.turn_at_middle_deg, 360 * kStiffPa / (kSoftPa + kStiffPa), 8);
  EXPECT_LT(MeanSection(volume, 0, 30), MeanSection(volume, 30, 60) - 0.05);
  EXPECT_GT(volume.volume_ratio, surface.volume_ratio + 0.1);
  EXPECT_GT(volume.SmallestSection(), surface.SmallestSection() + 0.1);
}

// Fig. 6: the cotangent field does not see the grading, the uniform one follows it.
TEST(BarTwistTest, CotangentFieldOfAGradedBarIsLinearAndTheUniformOneIsNot) {
  ASSERT_OK_AND_ASSIGN(const TwistProblem problem, GradedBar(4, 8, 24, 1));
  ASSERT_OK_AND_ASSIGN(const Eigen::VectorXd cotangent, TwistField(problem, Guidance::kCotangent));
  ASSERT_OK_AND_ASSIGN(const Eigen::VectorXd uniform, TwistField(problem, Guidance::kUniform));
  EXPECT_LT(DistanceFromLine(problem.bar, cotangent), 1e-10);
  EXPECT_GT(DistanceFromLine(problem.bar, uniform), 0.2);
}

TEST(BarTwistTest, CotangentGuidanceKeepsAGradedBarEvenAndUniformGuidanceDoesNot) {
  ASSERT_OK_AND_ASSIGN(const TwistProblem problem, GradedBar(4, 8, 24, 1));
  ASSERT_OK_AND_ASSIGN(const TwistResult cotangent, TwistVolume(problem, Guidance::kCotangent));
  ASSERT_OK_AND_ASSIGN(const TwistResult uniform, TwistVolume(problem, Guidance::kUniform));
  EXPECT_GT(cotangent.SmallestSection(), uniform.SmallestSection() + 0.1);
  const auto unevenness = [](const TwistResult& result) {
    return std::abs(MeanSection(result, 0, 30) - MeanSection(result, 30, 60));
  };
  EXPECT_LT(unevenness(cotangent), 0.2 * unevenness(uniform));
}

}  // namespace
}  // namespace tissueform
