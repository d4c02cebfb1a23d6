// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/releasable_models.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mechanics/deformation/create_deformer.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::StatusIs;

constexpr double kPoissonRatio = 0.4;

// A bar whose first two layers are fixed and whose last two are a handle, without every
// `left_out`-th of them.
ConstraintSet HeldBar(const TetMesh& bar, Eigen::Index left_out) {
  std::vector<int32_t> fixed;
  std::vector<int32_t> moved;
  for (Eigen::Index v = 0; v < bar.num_vertices(); ++v) {
    if (left_out > 0 && v % left_out == 0) continue;
    const double z = bar.positions()(v, 2);
    if (z < 1.5) fixed.push_back(static_cast<int32_t>(v));
    if (z > 10.5) moved.push_back(static_cast<int32_t>(v));
  }
  return *ConstraintSet::Create(bar, fixed, {{"end", moved}});
}

Positions ByDeformer(DeformationModel model, const TetMesh& bar, const Eigen::VectorXd& stiffness,
                     const ConstraintSet& constraints, const std::vector<HandlePose>& poses) {
  DeformerOptions options;
  options.model = model;
  options.preparation.poisson_ratio = kPoissonRatio;
  return (*CreateDeformer(bar, stiffness, constraints, options))->Deform(poses)->positions;
}

// Few are released at first, then more than one factor is kept for.
TEST(ReleasableModelsTest, AnswerAsTheDeformersWhileConstraintsBecomeFewer) {
  const TetMesh bar = testing::Bar({6, 6, 12}, 1.0, 0.2);
  const Eigen::VectorXd stiffness = Eigen::VectorXd::LinSpaced(bar.num_tets(), 5e3, 4e4);
  HandlePose pose;
  pose.translation_mm = {1, 0.5, -1};
  pose.rotation_vector = {0.2, 0, 0.5};
  pose.pivot_mm = {3, 3, 12};
  const std::vector<std::vector<HandlePose>> pose_sets = {{pose}, {PartOfPose(pose, 1.5)}};
  ASSERT_OK_AND_ASSIGN(const auto models,
                       ReleasableModels::Create(bar, stiffness, kPoissonRatio, 2));
  for (const Eigen::Index left_out : {0, 40, 20, 2}) {
    const ConstraintSet constraints = HeldBar(bar, left_out);
    ASSERT_OK_AND_ASSIGN(const auto propagated, models->GradientField(constraints, pose_sets));
    ASSERT_OK_AND_ASSIGN(const auto elastic, models->LinearElastic(constraints, pose_sets));
    ASSERT_EQ(propagated.size(), 2U);
    ASSERT_EQ(elastic.size(), 2U);
    for (size_t i = 0; i < 2; ++i) {
      const auto expected = [&](DeformationModel model) {
        return ByDeformer(model, bar, stiffness, constraints, pose_sets[i]);
      };
      EXPECT_LT((propagated[i] - expected(DeformationModel::kGradientField)).cwiseAbs().maxCoeff(),
                1e-9);
      EXPECT_LT((elastic[i] - expected(DeformationModel::kLinearElastic)).cwiseAbs().maxCoeff(),
                1e-9);
    }
  }
}

TEST(ReleasableModelsTest, AnswersDoNotDependOnThreads) {
  const TetMesh bar = testing::Bar({6, 6, 12}, 1.0, 0.2);
  const Eigen::VectorXd stiffness = Eigen::VectorXd::Constant(bar.num_tets(), 1e4);
  HandlePose pose;
  pose.translation_mm = {1, 0.5, -1};
  const std::vector<std::vector<HandlePose>> pose_sets = {{pose}};
  std::vector<Positions> answers;
  for (const int threads : {1, 2, 3}) {
    ASSERT_OK_AND_ASSIGN(const auto models,
                         ReleasableModels::Create(bar, stiffness, kPoissonRatio, threads));
    for (const Eigen::Index left_out : {0, 20}) {
      ASSERT_OK_AND_ASSIGN(const auto propagated,
                           models->GradientField(HeldBar(bar, left_out), pose_sets));
      ASSERT_OK_AND_ASSIGN(const auto elastic,
                           models->LinearElastic(HeldBar(bar, left_out), pose_sets));
      answers.push_back(propagated[0]);
      answers.push_back(elastic[0]);
    }
  }
  for (size_t i = 4; i < answers.size(); ++i) EXPECT_EQ(answers[i], answers[i % 4]) << i;
}

TEST(ReleasableModelsTest, BadMaterialsAreRefused) {
  const TetMesh bar = testing::Bar({2, 2, 2});
  const Eigen::VectorXd stiffness = Eigen::VectorXd::Constant(bar.num_tets(), 1e4);
  EXPECT_THAT(ReleasableModels::Create(bar, stiffness, 0.5, 1),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("Poisson")));
  EXPECT_THAT(ReleasableModels::Create(bar, -stiffness, 0.4, 1),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("stiffness")));
}

}  // namespace
}  // namespace tissueform
