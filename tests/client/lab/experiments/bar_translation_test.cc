// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/experiments/bar_translation.h"

#include "client/lab/experiments/update_experiment.h"
#include "core/mesh/bar_mesh.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

TranslationProblem SmallBar() { return {BarMesh(CubeGrid({3, 3, 15}, 1)).value(), 7, 1}; }

TEST(BarTranslationTest, UpdateZeroIsThePlainReconstruction) {
  ASSERT_OK_AND_ASSIGN(const Positions plain, TranslatePlainly(SmallBar()));
  ASSERT_OK_AND_ASSIGN(const TranslationResult result,
                       TranslateByIteration(SmallBar(), {}, {0, 1, 5}));
  EXPECT_LT(LargestDistance(result.after_update.at(0), plain), 1e-10);
  EXPECT_GT(LargestDistance(result.after_update.at(1), plain), 0.1);
  EXPECT_GT(LargestDistance(result.after_update.at(5), result.after_update.at(1)), 0.1);
}

TEST(BarTranslationTest, UpdatesAfterTheEndAreTheAnswer) {
  const IterationScheme scheme{BlendMap::kCosine, 5, 50, 1e-3};
  ASSERT_OK_AND_ASSIGN(const TranslationResult result,
                       TranslateByIteration(SmallBar(), scheme, {49}));
  EXPECT_TRUE(result.converged);
  EXPECT_LT(result.changes_mm.size(), 49U);
  EXPECT_EQ(result.after_update.at(49), result.positions);
}

// Fig. 3a: a shear, because every tet keeps its direction.
TEST(BarTranslationTest, PlainReconstructionOfATranslationIsAShear) {
  const TranslationProblem problem = SmallBar();
  ASSERT_OK_AND_ASSIGN(const Positions plain, TranslatePlainly(problem));
  Positions sheared = problem.bar.positions();
  sheared.col(0) += 7.0 / 15.0 * sheared.col(2);
  EXPECT_LT(LargestDistance(plain, sheared), 1e-10);
}

// Fig. 3b, where we differ from the source: the first update stays near the plain answer, the fixed
// point does not.
TEST(BarTranslationTest, FixedPointWithoutBlendingIsNotThePlainAnswer) {
  const TranslationProblem problem = SmallBar();
  ASSERT_OK_AND_ASSIGN(const UpdateSchemes schemes, CompareUpdateSchemes(problem));
  const double first = LargestDistance(schemes.not_blended.after_update.at(1), schemes.plain);
  const double last = LargestDistance(schemes.not_blended.positions, schemes.plain);
  EXPECT_LT(first, 0.1 * problem.translation_mm);
  EXPECT_GT(last, 1.5 * first);
}

// Fig. 3c: next to the ends the blended rotations are those of the ends, which do not turn.
TEST(BarTranslationTest, BlendedGradientsTurnInTheMiddleAndHardlyAtTheEnds) {
  const TranslationProblem problem = SmallBar();
  ASSERT_OK_AND_ASSIGN(const UpdateSchemes schemes, CompareUpdateSchemes(problem));
  ASSERT_OK_AND_ASSIGN(const Positions blended,
                       TurnedAxes(problem, schemes.plain, BlendMap::kCosine));
  ASSERT_OK_AND_ASSIGN(const Positions not_blended,
                       TurnedAxes(problem, schemes.plain, BlendMap::kUnblended));
  const Eigen::Index last = problem.bar.num_tets() - 1;
  const Eigen::Index middle = problem.bar.num_tets() / 2;
  EXPECT_LT(blended(0, 0), 0.2 * blended(middle, 0));
  EXPECT_LT(blended(last, 0), 0.2 * blended(middle, 0));
  // The plain answer is the same shear everywhere.
  EXPECT_NEAR(not_blended(0, 0), not_blended(middle, 0), 1e-9);
  EXPECT_NEAR(blended(middle, 0), not_blended(middle, 0), 0.02);
}

// Fig. 4.
TEST(BarTranslationTest, BothBlendsConvergeAndAccelerationTakesFewerUpdates) {
  for (const BlendMap blend : {BlendMap::kLinear, BlendMap::kCosine}) {
    const IterationScheme plain{blend, 0, 200, 1e-4};
    const IterationScheme accelerated{blend, 5, 200, 1e-4};
    ASSERT_OK_AND_ASSIGN(const TranslationResult slow, TranslateByIteration(SmallBar(), plain, {}));
    ASSERT_OK_AND_ASSIGN(const TranslationResult fast,
                         TranslateByIteration(SmallBar(), accelerated, {}));
    EXPECT_TRUE(slow.converged);
    EXPECT_TRUE(fast.converged);
    EXPECT_LT(fast.changes_mm.size(), slow.changes_mm.size());
    EXPECT_LT(LargestDistance(slow.positions, fast.positions), 5e-3);
  }
}

}  // namespace
}  // namespace tissueform
