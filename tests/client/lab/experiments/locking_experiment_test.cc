// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/experiments/locking_experiment.h"

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

TEST(LockingTest, ErrorOfPureBendingFallsWithTheMesh) {
  ASSERT_OK_AND_ASSIGN(const LockingError coarse, PureBendingError(2, 0.3));
  ASSERT_OK_AND_ASSIGN(const LockingError fine, PureBendingError(8, 0.3));
  EXPECT_LT(fine.mean_mm, coarse.mean_mm / 4);
}

TEST(LockingTest, NearlyIncompressibleTissueIsLessAccurateOnTheSameMesh) {
  ASSERT_OK_AND_ASSIGN(const LockingError compressible, PureBendingError(6, 0.3));
  ASSERT_OK_AND_ASSIGN(const LockingError nearly_not, PureBendingError(6, 0.499));
  EXPECT_GT(nearly_not.mean_percent, 2 * compressible.mean_percent);
}

TEST(LockingTest, BlockGoesWithItsPatchAndFinerMeshesAreCloserToEachOther) {
  constexpr std::array<int, 3> kCoarse = {6, 6, 4};
  constexpr std::array<int, 3> kMiddle = {12, 12, 8};
  constexpr std::array<int, 3> kFine = {24, 24, 16};
  ASSERT_OK_AND_ASSIGN(const Positions coarse, BlockDisplacements(kCoarse, 0.3));
  ASSERT_OK_AND_ASSIGN(const Positions middle, BlockDisplacements(kMiddle, 0.3));
  ASSERT_OK_AND_ASSIGN(const Positions fine, BlockDisplacements(kFine, 0.3));
  EXPECT_NEAR(coarse.col(2).maxCoeff(), 5, 0.5);
  EXPECT_LT(ErrorAgainstFiner(middle, kMiddle, fine, kFine).mean_mm,
            ErrorAgainstFiner(coarse, kCoarse, fine, kFine).mean_mm);
}

TEST(LockingTest, MeshHasNoErrorAgainstItself) {
  ASSERT_OK_AND_ASSIGN(const Positions found, BlockDisplacements({6, 6, 4}, 0.3));
  EXPECT_EQ(ErrorAgainstFiner(found, {6, 6, 4}, found, {6, 6, 4}).max_mm, 0);
}

}  // namespace
}  // namespace tissueform
