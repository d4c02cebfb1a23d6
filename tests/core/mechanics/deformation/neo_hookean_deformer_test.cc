// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/neo_hookean_deformer.h"

#include <numbers>

#include "gtest/gtest.h"

#include "core/mechanics/deformation/deformation_quality.h"
#include "core/mechanics/deformation/linear_elastic_deformer.h"
#include "core/mechanics/elasticity/neo_hookean_energy.h"
#include "tests/testing/elastic_bar.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using testing::BoundaryError;
using ::testing::HasSubstr;
using testing::IsOk;
using testing::Pose;
using testing::PrepareBar;
using testing::PrepareWrappedBlock;
using testing::StatusIs;

// Tighter than the default: the equilibrium itself is looked at.
constexpr double kTolerance = 1e-6;

std::unique_ptr<Deformer> Create(std::shared_ptr<MeshPreparation> preparation,
                                 const NeoHookeanOptions& options = {.tolerance = kTolerance}) {
  return CreateNeoHookeanDeformer(std::move(preparation), options).value();
}

Eigen::Index InvertedTets(const MeshPreparation& preparation, const Positions& positions) {
  return MeasureDeformation(preparation.mesh(), positions).inverted_tets;
}

double LargestDifference(const Positions& a, const Positions& b) {
  return (a - b).cwiseAbs().maxCoeff();
}

TEST(NeoHookeanDeformerTest, RestPosesGiveTheRestShape) {
  const auto preparation = PrepareBar().value();
  const Deformation answer = Create(preparation)->Deform({HandlePose{}}).value();
  EXPECT_EQ(answer.positions, preparation->mesh().positions());
  EXPECT_TRUE(answer.summary.converged);
  EXPECT_EQ(answer.summary.iterations, 0);
}

TEST(NeoHookeanDeformerTest, AnswerIsAnEquilibriumWithTheBoundaryInPlace) {
  const auto preparation = PrepareBar({}, 2).value();
  const std::vector<HandlePose> poses = {Pose({0.3, 0, 0.4}, {1, 0, 1.5}),
                                         Pose({0, 0, 0}, {0, 1, -1})};
  const Deformation answer = Create(preparation)->Deform(poses).value();
  ASSERT_TRUE(answer.summary.converged);
  EXPECT_LE(answer.summary.residual, kTolerance);
  EXPECT_EQ(answer.summary.load, 1.0);
  EXPECT_EQ(InvertedTets(*preparation, answer.positions), 0);
  EXPECT_LT(BoundaryError(*preparation, poses[0], 0, answer.positions), 1e-12);
  EXPECT_LT(BoundaryError(*preparation, poses[1], 1, answer.positions), 1e-12);

  NeoHookeanEnergy energy(preparation->elements(), preparation->vertex_cells(),
                          preparation->stiffness(), preparation->options().poisson_ratio, 1);
  Positions forces;
  energy.Evaluate(answer.positions - preparation->mesh().positions(), &forces);
  const double all = forces.norm();
  forces(preparation->constraints().constrained(), Eigen::all).setZero();
  EXPECT_LT(forces.norm(), 2e-6 * all);
}

TEST(NeoHookeanDeformerTest, DefaultToleranceIsRightToAFractionOfTheMovement) {
  const auto preparation = PrepareBar({}, 2).value();
  const std::vector<HandlePose> poses = {Pose({0.3, 0, 0.4}, {1, 0, 1.5}),
                                         Pose({0, 0, 0}, {0, 1, -1})};
  const Deformation quick = Create(preparation, {})->Deform(poses).value();
  const Deformation tight = Create(preparation, {.tolerance = 1e-9})->Deform(poses).value();
  ASSERT_TRUE(quick.summary.converged);
  ASSERT_TRUE(tight.summary.converged);
  EXPECT_LT(quick.summary.iterations, tight.summary.iterations);
  const double moved = LargestDifference(tight.positions, preparation->mesh().positions());
  EXPECT_LT(LargestDifference(quick.positions, tight.positions), 1e-4 * moved);
}

TEST(NeoHookeanDeformerTest, EnergyNeverRisesAndIsReported) {
  const auto preparation = PrepareBar().value();
  const auto answer = Create(preparation)->Deform({Pose({0, 0, 0}, {1, 0, 2})}).value();
  const SolveSummary& summary = answer.summary;
  ASSERT_GT(summary.iterations, 3);
  EXPECT_EQ(summary.energies_nj.size(), static_cast<size_t>(summary.iterations));
  EXPECT_EQ(summary.changes_mm.size(), static_cast<size_t>(summary.iterations));
  for (size_t i = 1; i < summary.energies_nj.size(); ++i) {
    EXPECT_LE(summary.energies_nj[i], summary.energies_nj[i - 1] * (1 + 1e-12));
  }
}

TEST(NeoHookeanDeformerTest, SmallMovesAreTheLinearModels) {
  const auto preparation = PrepareBar().value();
  const HandlePose pose = Pose({0, 0, 0}, {1e-4, 0, -1e-4});
  const Positions linear =
      CreateLinearElasticDeformer(preparation).value()->Deform({pose}).value().positions;
  const Deformation answer = Create(preparation)->Deform({pose}).value();
  EXPECT_TRUE(answer.summary.converged);
  EXPECT_LT(LargestDifference(answer.positions, linear), 1e-8);
}

TEST(NeoHookeanDeformerTest, RigidMotionOfEverythingIsReproduced) {
  // Fixed tissue cannot move, so the whole boundary is the handle.
  const auto preparation = PrepareWrappedBlock().value();
  const HandlePose pose = Pose({0, 0, std::numbers::pi}, {5, 0, 0});
  const Deformation answer = Create(preparation)->Deform({pose}).value();
  EXPECT_TRUE(answer.summary.converged);
  const auto quality = MeasureDeformation(preparation->mesh(), answer.positions);
  EXPECT_NEAR(quality.min_volume_ratio, 1, 1e-4);
  EXPECT_NEAR(quality.max_volume_ratio, 1, 1e-4);
}

TEST(NeoHookeanDeformerTest, LargeTwistIsReachedInLoadSteps) {
  const auto preparation = PrepareBar().value();
  const HandlePose pose = Pose({0, 0, std::numbers::pi / 2}, {0, 0, 0});
  const Deformation answer = Create(preparation)->Deform({pose}).value();
  EXPECT_TRUE(answer.summary.converged);
  EXPECT_EQ(answer.summary.load, 1.0);
  EXPECT_EQ(InvertedTets(*preparation, answer.positions), 0);
  EXPECT_LT(BoundaryError(*preparation, pose, 0, answer.positions), 1e-12);
}

TEST(NeoHookeanDeformerTest, FullTwistIsNotRest) {
  const auto preparation = PrepareBar().value();
  const HandlePose pose = Pose({0, 0, 2 * std::numbers::pi}, {0, 0, 0});
  const Deformation answer = Create(preparation, {.max_iterations = 3000})->Deform({pose}).value();
  EXPECT_EQ(answer.summary.load, 1.0);
  EXPECT_GT(LargestDifference(answer.positions, preparation->mesh().positions()), 1.0);
  EXPECT_EQ(InvertedTets(*preparation, answer.positions), 0);
}

TEST(NeoHookeanDeformerTest, ConvergesFromALinearStartThatInvertsTets) {
  const auto preparation = PrepareBar().value();
  const HandlePose pose = Pose({0.5, 0, 0}, {0, 0, -6.5});
  const Positions linear =
      CreateLinearElasticDeformer(preparation).value()->Deform({pose}).value().positions;
  ASSERT_GT(InvertedTets(*preparation, linear), 0);
  const Deformation answer = Create(preparation)->Deform({pose}).value();
  EXPECT_GT(answer.summary.load, 0.5);
  EXPECT_EQ(InvertedTets(*preparation, answer.positions), 0);
}

TEST(NeoHookeanDeformerTest, TheLoadShowsAnImpossiblePose) {
  const auto preparation = PrepareBar().value();
  const Deformation answer =
      Create(preparation, {.max_iterations = 100})->Deform({Pose({0, 0, 0}, {0, 0, -20})}).value();
  EXPECT_FALSE(answer.summary.converged);
  EXPECT_LT(answer.summary.load, 0.5);
  EXPECT_GT(answer.summary.load, 0.0);
  EXPECT_EQ(InvertedTets(*preparation, answer.positions), 0);
  const HandlePose reached = Pose({0, 0, 0}, {0, 0, -20 * answer.summary.load});
  EXPECT_LT(BoundaryError(*preparation, reached, 0, answer.positions), 1e-9);
}

TEST(NeoHookeanDeformerTest, RunningOutOfIterationsIsAResult) {
  const auto preparation = PrepareBar().value();
  const auto answer =
      Create(preparation, {.max_iterations = 2})->Deform({Pose({0, 0, 0}, {1, 0, 2})});
  ASSERT_THAT(answer, IsOk());
  EXPECT_FALSE(answer->summary.converged);
  EXPECT_EQ(answer->summary.iterations, 2);
  EXPECT_GT(answer->summary.residual, 1e-6);
  EXPECT_EQ(InvertedTets(*preparation, answer->positions), 0);
}

TEST(NeoHookeanDeformerTest, CallerMayStopAtEveryAnswer) {
  const auto preparation = PrepareBar().value();
  std::vector<int> seen;
  DeformControl control;
  control.on_progress = [&](const Deformation& so_far) {
    seen.push_back(so_far.summary.iterations);
    EXPECT_EQ(InvertedTets(*preparation, so_far.positions), 0);
    return seen.size() < 4;
  };
  const Deformation answer =
      Create(preparation)->Deform({Pose({0, 0, 0}, {1, 0, 2})}, control).value();
  EXPECT_EQ(seen, (std::vector<int>{0, 1, 2, 3}));
  EXPECT_TRUE(answer.summary.cancelled);
  EXPECT_FALSE(answer.summary.converged);
  EXPECT_EQ(answer.summary.iterations, 3);
}

TEST(NeoHookeanDeformerTest, OptionsOutOfRangeAreRefused) {
  const auto preparation = PrepareBar().value();
  EXPECT_THAT(CreateNeoHookeanDeformer(preparation, {.max_iterations = 0}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("max_iterations")));
  EXPECT_THAT(CreateNeoHookeanDeformer(preparation, {.tolerance = -1}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("tolerance")));
  EXPECT_THAT(CreateNeoHookeanDeformer(preparation, {.history = -1}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("history")));
}

TEST(NeoHookeanDeformerTest, AdmissionIsAskedForTheWorkspaces) {
  int calls = 0;
  PreparationOptions options;
  options.admission = [&calls](int64_t) {
    return ++calls < 3 ? absl::OkStatus() : absl::ResourceExhaustedError("no room");
  };
  EXPECT_THAT(CreateNeoHookeanDeformer(PrepareBar(options).value(), {}),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("no room")));
}

}  // namespace
}  // namespace tissueform
