// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/case_file/predicted_case.h"

#include <limits>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/core/planning/case_file/sample_case.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;

constexpr float kRounding = 1e-5F;

class PredictedCaseTest : public ::testing::Test {
 protected:
  Positions Deformed(const HandlePose& pose) const {
    Positions deformed = rest_;
    for (auto row : deformed.rowwise()) row = ApplyPose(pose, row.transpose()).transpose();
    return deformed;
  }

  const CaseFile case_ = SampleCase();
  const Positions rest_ = RestPositions(case_.mesh);
};

TEST_F(PredictedCaseTest, RestPositionsAreTheMeshes) {
  const Positions bar = testing::Bar({2, 2, 4}, 10).positions();
  EXPECT_EQ(rest_, bar);
}

TEST_F(PredictedCaseTest, NothingMovesAtRest) {
  ASSERT_OK_AND_ASSIGN(const PredictedCase predicted, PredictCase(case_, rest_, {{"top", {}}}));
  ASSERT_EQ(predicted.surfaces.size(), case_.surfaces.size());
  for (size_t s = 0; s < predicted.surfaces.size(); ++s) {
    EXPECT_EQ(predicted.surfaces[s], case_.surfaces[s].positions);
  }
  for (size_t l = 0; l < case_.landmarks.size(); ++l) {
    EXPECT_EQ(predicted.landmarks_mm[l], case_.landmarks[l].position_mm);
  }
}

TEST_F(PredictedCaseTest, WhenAllMovesAsOneBodySoDoesAllThatIsShown) {
  const HandlePose pose{
      .rotation_vector = {0.2, -0.1, 0.3}, .pivot_mm = {1, 2, 3}, .translation_mm = {4, -5, 6}};
  ASSERT_OK_AND_ASSIGN(const PredictedCase predicted,
                       PredictCase(case_, Deformed(pose), {{"top", pose}}));
  for (size_t s = 0; s < predicted.surfaces.size(); ++s) {
    const FloatPositions& before = case_.surfaces[s].positions;
    for (Eigen::Index v = 0; v < before.rows(); ++v) {
      const Eigen::Vector3d expected = ApplyPose(pose, before.row(v).cast<double>().transpose());
      EXPECT_LT((predicted.surfaces[s].row(v).transpose() - expected.cast<float>()).norm(),
                kRounding);
    }
  }
  EXPECT_LT((predicted.landmarks_mm[0] - ApplyPose(pose, {1, 1, 1})).norm(), kRounding);
  // It goes with vertex 5 of the skin, which is not where it lies.
  const Eigen::Vector3d vertex = case_.surfaces[0].positions.row(5).cast<double>().transpose();
  EXPECT_LT((predicted.landmarks_mm[1] - case_.landmarks[1].position_mm -
             (ApplyPose(pose, vertex) - vertex))
                .norm(),
            kRounding);
}

TEST_F(PredictedCaseTest, APredictionOfAnotherMeshIsRefused) {
  EXPECT_THAT(PredictCase(case_, rest_.topRows(3), {{"top", {}}}).status().message(),
              HasSubstr("positions of 3 vertices"));
}

TEST_F(PredictedCaseTest, ASegmentWithoutAPoseIsRefused) {
  EXPECT_THAT(PredictCase(case_, rest_, {}).status().message(),
              HasSubstr("no pose for the handle \"top\""));
}

TEST_F(PredictedCaseTest, RefusesNonFiniteNumbers) {
  Positions deformed = rest_;
  deformed(0, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(PredictCase(case_, deformed, {{"top", {}}}).status().message(),
              HasSubstr("not a number"));
  EXPECT_THAT(
      PredictCase(case_, rest_, {{"top", {.translation_mm = {1e300, 0, 0}}}}).status().message(),
      HasSubstr("too far to be valid"));
}

}  // namespace
}  // namespace tissueform
