// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/newton_fallback.h"

#include <numbers>

#include "gtest/gtest.h"

#include "core/mechanics/deformation/deformation_quality.h"
#include "core/mechanics/deformation/neo_hookean_deformer.h"
#include "tests/testing/elastic_bar.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::IsOk;
using testing::Pose;
using testing::PrepareBar;

constexpr double kThird = 2 * std::numbers::pi / 3;
// So many that L-BFGS is left alone.
constexpr int kNever = 1000000;
// From the first step on.
constexpr NeoHookeanOptions kNewton = {.tolerance = 1e-6, .newton_after = 0};

// Cells of 1 mm, jittered; layers of `ends_mm` at both ends of the z axis, the lower one fixed (or
// a second handle), the upper one the handle "top".
std::shared_ptr<MeshPreparation> PrepareBlock(const std::array<int, 3>& cells, double ends_mm,
                                              bool is_base_fixed = true) {
  const TetMesh mesh = testing::Bar(cells, 1.0, 0.1);
  auto base = testing::SelectVertices(
      mesh, [&](const Eigen::Vector3d& v) { return v.z() < ends_mm + 0.5; });
  auto top = testing::SelectVertices(
      mesh, [&](const Eigen::Vector3d& v) { return v.z() > cells[2] - ends_mm - 0.5; });
  const auto constraints =
      is_base_fixed
          ? ConstraintSet::Create(mesh, std::move(base), {{"top", std::move(top)}})
          : ConstraintSet::Create(mesh, {}, {{"base", std::move(base)}, {"top", std::move(top)}});
  const Eigen::VectorXd stiffness = Eigen::VectorXd::Constant(mesh.num_tets(), 15000.0);
  return MeshPreparation::Create(mesh, stiffness, constraints.value(), {}).value();
}

HandlePose PoseAbout(const Eigen::Vector3d& rotation_vector, const Eigen::Vector3d& pivot_mm,
                     const Eigen::Vector3d& translation_mm = Eigen::Vector3d::Zero()) {
  HandlePose pose;
  pose.rotation_vector = rotation_vector;
  pose.pivot_mm = pivot_mm;
  pose.translation_mm = translation_mm;
  return pose;
}

// A limb of 1 x 1 x 40 mm whose end is turned by 60 degrees, moved aside and pushed together: it
// buckles.
std::shared_ptr<MeshPreparation> PrepareLimb() { return PrepareBlock({1, 1, 40}, 0); }
HandlePose LimbPose() {
  return PoseAbout({std::numbers::pi / 3, 0, 0}, {0.5, 0.5, 40}, {3.2, 0, -5});
}

Deformation Solve(const std::shared_ptr<MeshPreparation>& preparation,
                  const NeoHookeanOptions& options, const std::vector<HandlePose>& poses,
                  const DeformControl& control = {}) {
  return CreateNeoHookeanDeformer(preparation, options).value()->Deform(poses, control).value();
}

void ExpectEquilibrium(const MeshPreparation& preparation, const Deformation& answer) {
  EXPECT_TRUE(answer.summary.converged);
  EXPECT_EQ(answer.summary.load, 1.0);
  EXPECT_EQ(answer.summary.gave_up, Termination::kConverged);
  EXPECT_EQ(answer.summary.obstacle, "");
  EXPECT_EQ(MeasureDeformation(preparation.mesh(), answer.positions).inverted_tets, 0);
}

void ExpectFallingEnergies(const SolveSummary& summary) {
  for (size_t i = 1; i < summary.energies_nj.size(); ++i) {
    EXPECT_LE(summary.energies_nj[i], summary.energies_nj[i - 1] * (1 + 1e-12)) << "step " << i;
  }
}

TEST(StallWatchTest, StallsWhenTheResidualHasNotHalvedInTime) {
  StagnationDetector watch(3);
  for (const double residual : {1.0, 0.9, 0.8}) EXPECT_FALSE(watch.HasStalled(residual));
  EXPECT_TRUE(watch.HasStalled(0.7));
}

TEST(StallWatchTest, RestartsItsPatienceWhenTheResidualHasHalved) {
  StagnationDetector watch(3);
  for (const double residual : {1.0, 0.9, 0.5, 0.4, 0.3}) {
    EXPECT_FALSE(watch.HasStalled(residual));
  }
  EXPECT_TRUE(watch.HasStalled(0.26));
}

TEST(StallWatchTest, WithoutPatienceItStallsAtOnce) {
  EXPECT_TRUE(StagnationDetector(0).HasStalled(1.0));
}

TEST(NewtonFallbackTest, ThinLimbConvergesWhereLbfgsAloneDoesNot) {
  const auto preparation = PrepareLimb();
  const Deformation alone = Solve(preparation, {.newton_after = kNever}, {LimbPose()});
  EXPECT_FALSE(alone.summary.converged);
  EXPECT_EQ(alone.summary.newton_steps, 0);
  EXPECT_EQ(alone.summary.gave_up, Termination::kIterations);
  const Deformation answer = Solve(preparation, {}, {LimbPose()});
  ExpectEquilibrium(*preparation, answer);
  EXPECT_GT(answer.summary.newton_steps, 0);
  EXPECT_LT(answer.summary.iterations, alone.summary.iterations / 2);
}

TEST(NewtonFallbackTest, ThickHandlesTurnBy120DegreesAboutAThinBlock) {
  const auto preparation = PrepareBlock({8, 6, 8}, 2);
  const HandlePose bent = PoseAbout({0, kThird, 0}, {4, 3, 4});
  EXPECT_FALSE(Solve(preparation, {.max_iterations = 500, .newton_after = kNever}, {bent})
                   .summary.converged);
  ExpectEquilibrium(*preparation, Solve(preparation, {}, {bent}));
  ExpectEquilibrium(*preparation, Solve(preparation, {}, {PoseAbout({0, 0, kThird}, {4, 3, 4})}));
}

TEST(NewtonFallbackTest, HandlesThatPassThroughEachOtherAreNamed) {
  const auto preparation = PrepareBlock({4, 4, 6}, 2, false);
  const HandlePose rest = PoseAbout({0, 0, 0}, {2, 2, 1});
  const Deformation answer =
      Solve(preparation, {}, {rest, PoseAbout({0, 0, 0}, {2, 2, 5}, {0, 0, -4})});
  EXPECT_FALSE(answer.summary.converged);
  EXPECT_EQ(answer.summary.gave_up, Termination::kBlocked);
  EXPECT_EQ(answer.summary.obstacle, "handle \"top\" would pass through handle \"base\"");
  // Two millimetres lie between them.
  EXPECT_LT(answer.summary.load, 0.5);
  EXPECT_GT(answer.summary.load, 0.4);
  EXPECT_EQ(MeasureDeformation(preparation->mesh(), answer.positions).inverted_tets, 0);
}

TEST(NewtonFallbackTest, AHandleThatPassesThroughFixedVerticesIsNamed) {
  const auto preparation = PrepareBlock({4, 4, 6}, 2);
  const Deformation answer = Solve(preparation, {}, {PoseAbout({0, 0, 0}, {2, 2, 5}, {0, 0, -4})});
  EXPECT_EQ(answer.summary.gave_up, Termination::kBlocked);
  EXPECT_EQ(answer.summary.obstacle, "handle \"top\" would pass through the fixed vertices");
}

// With all tets positive: the tissue is led around the fixed layer, at an energy that Newton steps
// would find the least of.
TEST(NewtonFallbackTest, AHandleDoesNotPassThroughAThinRegionAsAWhole) {
  const Deformation answer = Solve(PrepareBar().value(), {}, {Pose({0, 0, 0}, {0, 0, -20})});
  EXPECT_FALSE(answer.summary.converged);
  EXPECT_EQ(answer.summary.gave_up, Termination::kBlocked);
  EXPECT_EQ(answer.summary.obstacle, "handle \"top\" would pass through the fixed vertices");
  // Eight millimetres lie between them.
  EXPECT_NEAR(answer.summary.load, 0.4, 0.01);
}

TEST(NewtonFallbackTest, ReportsRunningOutOfIterations) {
  const Deformation answer =
      Solve(PrepareBar().value(), {.max_iterations = 2}, {Pose({0, 0, 0}, {1, 0, 2})});
  EXPECT_EQ(answer.summary.gave_up, Termination::kIterations);
  EXPECT_EQ(answer.summary.obstacle, "");
}

TEST(NewtonFallbackTest, IsNotUsedWhenLbfgsConverges) {
  const auto preparation = PrepareBar({}, 2).value();
  const std::vector<HandlePose> poses = {Pose({0.3, 0, 0.4}, {1, 0, 1.5}),
                                         Pose({0, 0, 0}, {0, 1, -1})};
  const Deformation answer = Solve(preparation, {}, poses);
  ASSERT_TRUE(answer.summary.converged);
  EXPECT_EQ(answer.summary.newton_steps, 0);
  EXPECT_EQ(answer.summary.second_factor_bytes, 0);
  EXPECT_EQ(answer.positions, Solve(preparation, {.newton_after = kNever}, poses).positions);
}

TEST(NewtonFallbackTest, FindsTheEquilibriumOfLbfgsInFewerStepsWithoutRaisingTheEnergy) {
  const auto preparation = PrepareBar({}, 2).value();
  const std::vector<HandlePose> poses = {Pose({0.3, 0, 0.4}, {1, 0, 1.5}),
                                         Pose({0, 0, 0}, {0, 1, -1})};
  const Deformation lbfgs = Solve(preparation, {.tolerance = 1e-9, .newton_after = kNever}, poses);
  const Deformation newton = Solve(preparation, {.tolerance = 1e-9, .newton_after = 0}, poses);
  ExpectEquilibrium(*preparation, newton);
  EXPECT_GT(newton.summary.newton_steps, 0);
  EXPECT_LT(newton.summary.iterations, lbfgs.summary.iterations);
  EXPECT_LT((newton.positions - lbfgs.positions).cwiseAbs().maxCoeff(), 1e-7);
  ExpectFallingEnergies(newton.summary);
}

TEST(NewtonFallbackTest, MoreThreadsForItsFactorsFindTheSameEquilibrium) {
  const auto preparation = PrepareBar({}, 2).value();
  const std::vector<HandlePose> poses = {Pose({0.3, 0, 0.4}, {1, 0, 1.5}),
                                         Pose({0, 0, 0}, {0, 1, -1})};
  const Deformation one = Solve(preparation, {.tolerance = 1e-9, .newton_after = 0}, poses);
  const Deformation two =
      Solve(preparation, {.tolerance = 1e-9, .newton_after = 0, .newton_blas_threads = 2}, poses);
  EXPECT_EQ(two.summary.newton_steps, one.summary.newton_steps);
  EXPECT_LT((two.positions - one.positions).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(NewtonFallbackTest, EnergyNeverRisesOnOneTet) {
  const TetMesh mesh = testing::SingleTet();
  const auto constraints = ConstraintSet::Create(mesh, {0}, {{"edge", {1, 2}}}).value();
  const auto preparation =
      MeshPreparation::Create(mesh, Eigen::VectorXd::Constant(1, 3000.0), constraints, {}).value();
  const HandlePose pose = PoseAbout({0.4, 0, 0.2}, mesh.positions().row(0), {0.1, 0.1, -0.05});
  const Deformation answer = Solve(preparation, kNewton, {pose});
  ExpectEquilibrium(*preparation, answer);
  EXPECT_GT(answer.summary.newton_steps, 0);
  ExpectFallingEnergies(answer.summary);
}

TEST(NewtonFallbackTest, EnergyNeverRisesOnTheTongue) {
  const TetMesh mesh = testing::LoadTestMesh("plans/tongue/volumetricTongue.vtu");
  const auto root =
      testing::SelectVertices(mesh, [](const Eigen::Vector3d& v) { return v.z() < -2.6; });
  const auto tip =
      testing::SelectVertices(mesh, [](const Eigen::Vector3d& v) { return v.z() > -0.25; });
  const auto preparation =
      MeshPreparation::Create(mesh, Eigen::VectorXd::Constant(mesh.num_tets(), 15000.0),
                              ConstraintSet::Create(mesh, root, {{"tip", tip}}).value(), {})
          .value();
  const HandlePose pose = PoseAbout({-0.35, 0, 0}, {0.05, 0.9, -0.25}, {0, 0.3, 0});
  const Deformation answer = Solve(preparation, kNewton, {pose});
  ExpectEquilibrium(*preparation, answer);
  EXPECT_GT(answer.summary.newton_steps, 0);
  EXPECT_LT(answer.summary.iterations, 30);
  ExpectFallingEnergies(answer.summary);
}

TEST(NewtonFallbackTest, MemoryIsRequestedOnceAndReported) {
  const auto preparation = PrepareLimb();
  std::vector<int64_t> asked;
  DeformControl control;
  control.admission = [&asked](int64_t bytes) {
    asked.push_back(bytes);
    return absl::OkStatus();
  };
  const Deformation answer = Solve(preparation, {}, {LimbPose()}, control);
  ASSERT_GT(answer.summary.newton_steps, 1);
  ASSERT_EQ(asked.size(), 1U);
  EXPECT_EQ(answer.summary.second_factor_bytes, asked[0]);
  EXPECT_GT(asked[0], preparation->Elastic().value()->system().bytes_held());
}

TEST(NewtonFallbackTest, WithoutRoomForTheFactorTheSearchGoesOnAndSaysWhyItFailed) {
  DeformControl control;
  control.admission = [](int64_t) { return absl::ResourceExhaustedError("no room"); };
  const Deformation answer = Solve(PrepareLimb(), {.max_iterations = 600}, {LimbPose()}, control);
  EXPECT_FALSE(answer.summary.converged);
  EXPECT_EQ(answer.summary.iterations, 600);
  EXPECT_EQ(answer.summary.newton_steps, 0);
  EXPECT_EQ(answer.summary.gave_up, Termination::kNoRoom);
  EXPECT_EQ(answer.summary.second_factor_bytes, 0);
}

TEST(NewtonFallbackTest, CallerMayStopBetweenNewtonSteps) {
  int newton_steps = 0;
  DeformControl control;
  control.on_progress = [&newton_steps](const Deformation& so_far) {
    newton_steps = so_far.summary.newton_steps;
    return newton_steps < 2;
  };
  const Deformation answer = Solve(PrepareLimb(), {}, {LimbPose()}, control);
  EXPECT_EQ(newton_steps, 2);
  EXPECT_TRUE(answer.summary.cancelled);
  EXPECT_EQ(answer.summary.newton_steps, 2);
  EXPECT_EQ(answer.summary.gave_up, Termination::kConverged);
}

TEST(NewtonFallbackTest, WarmStartEndsAtTheSameAnswer) {
  const auto preparation = PrepareLimb();
  const auto warm = CreateNeoHookeanDeformer(preparation, {.tolerance = 1e-7}).value();
  ASSERT_THAT(warm->Deform({LimbPose()}), IsOk());
  HandlePose pose = LimbPose();
  pose.translation_mm += Eigen::Vector3d(0.5, 0, -0.5);
  const Deformation started = warm->Deform({pose}, {.warm_start = true, .on_progress = {}}).value();
  ExpectEquilibrium(*preparation, started);
  const Deformation cold = Solve(preparation, {.tolerance = 1e-7}, {pose});
  EXPECT_LT((started.positions - cold.positions).cwiseAbs().maxCoeff(), 1e-3);
}

TEST(NewtonFallbackTest, NegativePatienceIsRefused) {
  EXPECT_THAT(CreateNeoHookeanDeformer(PrepareBar().value(), {.newton_after = -1}),
              testing::StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("newton_after")));
}

}  // namespace
}  // namespace tissueform
