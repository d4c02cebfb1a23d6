// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/turning_contact.h"

#include <algorithm>
#include <memory>
#include <random>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <Eigen/Geometry>

#include "core/mechanics/deformation/create_deformer.h"
#include "core/mechanics/elasticity/neo_hookean_energy.h"
#include "tests/core/mechanics/deformation/sliding_block.h"
#include "tests/testing/elastic_bar.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::tissueform::testing::GapsOf;
using ::tissueform::testing::Pose;
using ::tissueform::testing::RandomPose;
using ::tissueform::testing::SlidingBlock;
using ::tissueform::testing::StatusIs;

DeformerOptions NeoHookean(double tolerance = 1e-4) {
  DeformerOptions options;
  options.model = DeformationModel::kNeoHookean;
  options.neo_hookean.tolerance = tolerance;
  return options;
}

TEST(TurningContactTest, RowsHoldInEveryPose) {
  testing::ExpectRowsHoldInEveryPose(NeoHookean(), {.normals_turn = true,
                                                    .bilateral = 1e-6,
                                                    .penetration = 2e-3,
                                                    .reported_gap = 1e-9,
                                                    .residual = 2e-3});
}

// The gradient of the energy is what the rows bear: nothing at vertices without rows, along the
// normals at the others.
TEST(TurningContactTest, RowsBearTheGradientOfTheEnergy) {
  const auto preparation = SlidingBlock().Prepare();
  const std::vector<ContactRow>& rows = preparation->constraints().contact();
  const auto deformer = *CreateDeformer(preparation, NeoHookean(1e-8));
  std::mt19937 generator(3);
  NeoHookeanEnergy energy(preparation->elements(), preparation->vertex_cells(),
                          preparation->stiffness(), preparation->options().poisson_ratio, 1);
  for (int i = 0; i < 5; ++i) {
    const HandlePose pose = RandomPose(&generator);
    const Eigen::Matrix3d turn = RotationMatrix(pose.rotation_vector);
    const Deformation answer = *deformer->Deform({pose});
    ASSERT_TRUE(answer.summary.converged);
    Positions gradient;
    energy.Evaluate(answer.positions - preparation->mesh().positions(), &gradient);
    const double size = gradient.norm();
    for (const int32_t v : preparation->constraints().constrained()) gradient.row(v).setZero();
    size_t unilateral = 0;
    for (const ContactRow& row : rows) {
      const Eigen::RowVector3d normal =
          (row.handle == SlidingBlock::kBone ? turn * row.normal : row.normal).transpose();
      const double force = row.bilateral ? gradient.row(row.vertex).dot(normal)
                                         : answer.contact.forces[unilateral++];
      gradient.row(row.vertex) -= force * normal;
      if (row.other != ContactRow::kBone) gradient.row(row.other) += force * normal;
    }
    EXPECT_LT(gradient.norm(), 1e-6 * size);
  }
}

TEST(TurningContactTest, ASmallMotionIsAnsweredAsByTheLinearModel) {
  const auto preparation = SlidingBlock().Prepare();
  const auto neo_hookean = *CreateDeformer(preparation, NeoHookean(1e-9));
  DeformerOptions linear;
  linear.model = DeformationModel::kLinearElastic;
  const auto linear_elastic = *CreateDeformer(preparation, linear);
  const auto distance = [&](double part) {
    HandlePose pose =
        Pose(part * Eigen::Vector3d(0.2, -0.1, 0.3), part * Eigen::Vector3d(1, 2, -1));
    return (neo_hookean->Deform({pose})->positions - linear_elastic->Deform({pose})->positions)
        .cwiseAbs()
        .maxCoeff();
  };
  const double far = distance(1e-2);
  const double near = distance(5e-3);
  EXPECT_LT(far, 1e-3);
  EXPECT_GT(far, 3.5 * near) << "the distance is of second order";
  EXPECT_LT(far, 4.5 * near);
}

TEST(TurningContactTest, AMovementOfEverythingIsThatMovementWithoutAnyForce) {
  SlidingBlock block;
  block.held_.insert(block.held_.end(), block.fixed_.begin(), block.fixed_.end());
  block.fixed_ = {};
  // The normals between two vertices do not turn.
  std::erase_if(block.rows_, [](const auto& row) { return row.other != ContactRow::kBone; });
  for (ContactRow& row : block.rows_) row.gap_mm = 0;
  const auto preparation = block.Prepare();
  const HandlePose pose = Pose({0.6, -0.4, 0.7}, {3, -2, 5});
  const Deformation answer = *(*CreateDeformer(preparation, NeoHookean(1e-6)))->Deform({pose});
  EXPECT_TRUE(answer.summary.converged);
  for (Eigen::Index v = 0; v < answer.positions.rows(); ++v) {
    const Eigen::Vector3d expected = ApplyPose(pose, block.mesh_.positions().row(v));
    EXPECT_LT((answer.positions.row(v).transpose() - expected).norm(), 1e-6);
  }
}

// Rows in three directions are what a region is.
TEST(TurningContactTest, SlidingInNoDirectionIsSticking) {
  const SlidingBlock block(/*only_bilateral=*/true);
  const auto sliding = block.WithRowsInAllDirections().Prepare();
  const auto sticking = block.Sticking().Prepare();
  const HandlePose pose = Pose({0.2, -0.1, 0.3}, {0.3, -0.2, 0.2});
  const Deformation found = *(*CreateDeformer(sliding, NeoHookean(1e-11)))->Deform({pose});
  const Deformation expected = *(*CreateDeformer(sticking, NeoHookean(1e-11)))->Deform({pose});
  EXPECT_LT((found.positions - expected.positions).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_GT((expected.positions - block.mesh_.positions()).cwiseAbs().maxCoeff(), 0.1);
}

TEST(TurningContactTest, AnswersDoNotDependOnTheDragBefore) {
  const auto preparation = SlidingBlock().Prepare();
  const auto dragged = *CreateDeformer(preparation, NeoHookean(1e-7));
  const auto fresh = *CreateDeformer(preparation, NeoHookean(1e-7));
  DeformControl warmly;
  warmly.warm_start = true;
  std::mt19937 generator(9);
  for (int i = 0; i < 10; ++i) {
    const HandlePose pose = RandomPose(&generator);
    const Deformation warm = *dragged->Deform({pose}, warmly);
    const Deformation cold = *fresh->Deform({pose});
    ASSERT_TRUE(warm.summary.converged && cold.summary.converged);
    EXPECT_LT((warm.positions - cold.positions).cwiseAbs().maxCoeff(), 2e-3);
  }
}

// Pressed through the block and far beyond.
TEST(TurningContactTest, ReportsAPoseThatCannotBeReached) {
  const auto preparation = SlidingBlock().Prepare();
  const auto deformer = *CreateDeformer(preparation, NeoHookean());
  const Deformation answer = *deformer->Deform({Pose({0, 0, 0}, {0, 0, -15})});
  EXPECT_FALSE(answer.summary.converged);
  EXPECT_LT(answer.summary.load, 1);
  EXPECT_GT(answer.summary.load, 0.2);
  EXPECT_THAT(answer.summary.obstacle, HasSubstr("bone"));
  // At the load that was reached the rows hold.
  const HandlePose reached = Pose({0, 0, 0}, {0, 0, -15 * answer.summary.load});
  const Eigen::VectorXd gaps =
      GapsOf(*preparation, answer.positions - preparation->mesh().positions(), reached, true);
  size_t unilateral = 0;
  for (size_t r = 0; r < preparation->constraints().contact().size(); ++r) {
    const double gap = gaps[static_cast<Eigen::Index>(r)];
    if (preparation->constraints().contact()[r].bilateral) {
      EXPECT_NEAR(gap, 0, 1e-6);
    } else {
      EXPECT_NEAR(gap, answer.contact.gaps_mm[unilateral++], 1e-9);
    }
  }
  // The next answer is not harmed.
  EXPECT_TRUE(deformer->Deform({Pose({0, 0, 0}, {0, 0, -0.3})})->summary.converged);
}

TEST(TurningContactTest, AVertexThatSlidesOnTwoBonesIsRefused) {
  SlidingBlock block(/*only_bilateral=*/true);
  ContactRow row = block.rows_[0];
  row.normal = row.normal.unitOrthogonal();
  row.handle = ContactRow::kFixedBone;
  block.rows_.push_back(row);
  EXPECT_THAT(CreateDeformer(block.Prepare(), NeoHookean()),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("are of two bones")));
}

}  // namespace
}  // namespace tissueform
