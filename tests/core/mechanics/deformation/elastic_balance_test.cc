// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "gtest/gtest.h"

#include "core/mechanics/deformation/create_deformer.h"
#include "core/mechanics/elasticity/elastic_state.h"
#include "tests/testing/elastic_bar.h"
#include "tests/testing/handle_problem.h"

// What the elastic models' answers bear: reactions, energy and how they belong together.
namespace tissueform {
namespace {

ElasticLaw LawOf(DeformationModel model) {
  return model == DeformationModel::kLinearElastic ? ElasticLaw::kLinear : ElasticLaw::kNeoHookean;
}

// The model's answer to poses, converged as far as it goes.
class Answer {
 public:
  Answer(const std::shared_ptr<MeshPreparation>& preparation, DeformationModel model,
         const std::vector<HandlePose>& poses)
      : preparation_(preparation) {
    DeformerOptions options;
    options.model = model;
    options.neo_hookean.tolerance = 1e-9;
    const Deformation deformation = (*CreateDeformer(preparation, options))->Deform(poses).value();
    EXPECT_TRUE(deformation.summary.converged) << deformation.summary.residual;
    state_ = MeasureElasticState(LawOf(model), preparation_->elements(), deformation.positions,
                                 preparation_->stiffness(), preparation_->options().poisson_ratio);
    displacements_ = deformation.positions - preparation_->mesh().positions();
  }

  const ElasticState& state() const { return state_; }
  const Positions& displacements() const { return displacements_; }
  Resultant OfHandle(size_t handle) const {
    return ResultantOf(state_, preparation_->constraints().handles()[handle].vertices);
  }
  // Of the fixed vertices and of every handle.
  std::vector<Resultant> Reactions() const {
    std::vector<Resultant> reactions = {ResultantOf(state_, preparation_->constraints().fixed())};
    for (size_t h = 0; h < preparation_->constraints().handles().size(); ++h) {
      reactions.push_back(OfHandle(h));
    }
    return reactions;
  }

 private:
  std::shared_ptr<MeshPreparation> preparation_;
  ElasticState state_;
  Positions displacements_;
};

// Reactions and their moments about the origin, over the largest of them.
void ExpectBalance(const std::vector<Resultant>& reactions) {
  Eigen::Vector3d force = Eigen::Vector3d::Zero();
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
  double largest_force = 0;
  double largest_moment = 0;
  for (const Resultant& reaction : reactions) {
    const Eigen::Vector3d about_origin =
        reaction.moment_n_mm + reaction.about_mm.cross(reaction.force_n);
    force += reaction.force_n;
    moment += about_origin;
    largest_force = std::max(largest_force, reaction.force_n.norm());
    largest_moment = std::max(largest_moment, about_origin.norm());
  }
  EXPECT_GT(largest_force, 0);
  EXPECT_LT(force.norm(), 1e-7 * largest_force);
  EXPECT_LT(moment.norm(), 1e-7 * largest_moment);
}

std::vector<HandlePose> TwoPoses() {
  return {testing::Pose({0.3, -0.2, 0.4}, {0.5, -0.3, 0.8}, 1.05),
          testing::Pose({-0.2, 0.1, 0}, {-0.2, 0.6, 0.3})};
}

class ElasticBalanceTest : public ::testing::TestWithParam<DeformationModel> {};

INSTANTIATE_TEST_SUITE_P(Models, ElasticBalanceTest,
                         ::testing::Values(DeformationModel::kLinearElastic,
                                           DeformationModel::kNeoHookean),
                         [](const auto& model) {
                           return model.param == DeformationModel::kLinearElastic ? "LinearElastic"
                                                                                  : "NeoHookean";
                         });

TEST_P(ElasticBalanceTest, ReactionsOfHandlesAndFixedVerticesSumToZero) {
  ExpectBalance(Answer(testing::PrepareBar({}, 2).value(), GetParam(), TwoPoses()).Reactions());
}

TEST_P(ElasticBalanceTest, ReactionsOnTheTongueSumToZero) {
  const TetMesh tongue = testing::LoadTestMesh("meshes/tet_sofa_tongue/volumetricTongue.vtu");
  const auto preparation = testing::PrepareMesh(tongue, 2);
  testing::RandomNumbers random(7);
  const auto poses = testing::RandomPoses(2, 0.2, 0.0, 0.5, &random);
  ExpectBalance(Answer(preparation, GetParam(), poses).Reactions());
}

// Of the work that a handle does on its way, by the difference of two answers: force along a
// direction, moment about an axis through the mean of its vertices.
TEST_P(ElasticBalanceTest, ReactionIsTheSlopeOfTheEnergyByTheHandlesMovement) {
  const auto preparation = testing::PrepareBar().value();
  const std::vector<int32_t>& vertices = preparation->constraints().handles()[0].vertices;
  HandlePose pose;
  pose.pivot_mm =
      preparation->mesh().positions()(vertices, Eigen::all).colwise().mean().transpose();
  pose.translation_mm = {0.7, -0.4, 0.9};
  const Resultant reaction = Answer(preparation, GetParam(), {pose}).OfHandle(0);
  const auto slope = [&](Eigen::Vector3d HandlePose::*coordinate, int axis) {
    constexpr double kStep = 1e-3;
    const auto energy = [&](double change) {
      HandlePose moved = pose;
      (moved.*coordinate)[axis] += change;
      return Answer(preparation, GetParam(), {moved}).state().strain_energy_mj;
    };
    return (energy(kStep) - energy(-kStep)) / (2 * kStep);
  };
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(slope(&HandlePose::translation_mm, axis), reaction.force_n[axis],
                1e-5 * reaction.force_n.norm());
    EXPECT_NEAR(slope(&HandlePose::rotation_vector, axis), reaction.moment_n_mm[axis],
                1e-5 * reaction.moment_n_mm.norm());
  }
}

TEST(LinearElasticEnergyTest, IsHalfOfReactionsTimesDisplacements) {
  const auto preparation = testing::PrepareBar({}, 2).value();
  const Answer answer(preparation, DeformationModel::kLinearElastic, TwoPoses());
  double work = 0;
  for (const int32_t v : preparation->constraints().constrained()) {
    work += answer.state().forces_n.row(v).dot(answer.displacements().row(v));
  }
  EXPECT_NEAR(answer.state().strain_energy_mj, 0.5 * work, 1e-10 * work);
}

// A handle that only moves: all of the work is its force times its way.
TEST(LinearElasticEnergyTest, IsHalfOfAMovedHandlesReactionTimesItsTranslation) {
  const Eigen::Vector3d translation(1, -2, 0.5);
  const Answer answer(testing::PrepareBar().value(), DeformationModel::kLinearElastic,
                      {testing::Pose({0, 0, 0}, translation)});
  const double work = answer.OfHandle(0).force_n.dot(translation);
  EXPECT_GT(work, 0) << "the handle pushes where it goes";
  EXPECT_NEAR(answer.state().strain_energy_mj, 0.5 * work, 1e-10 * work);
}

}  // namespace
}  // namespace tissueform
