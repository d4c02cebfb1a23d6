// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/linear_elastic_deformer.h"

#include "gtest/gtest.h"

#include "tests/testing/elastic_bar.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using testing::BoundaryError;
using testing::IsOk;
using testing::Pose;
using testing::PrepareBar;

double LargestDifference(const Positions& a, const Positions& b) {
  return (a - b).cwiseAbs().maxCoeff();
}

TEST(LinearElasticDeformerTest, RestPosesGiveTheRestShape) {
  const auto preparation = PrepareBar({}, 2).value();
  const auto deformer = CreateLinearElasticDeformer(preparation).value();
  const Positions answer = deformer->Deform({HandlePose{}, HandlePose{}}).value().positions;
  EXPECT_EQ(answer, preparation->mesh().positions());
}

TEST(LinearElasticDeformerTest, EqualsTheDirectSolve) {
  const auto preparation = PrepareBar({}, 2).value();
  const auto deformer = CreateLinearElasticDeformer(preparation).value();
  for (const double angle : {0.01, 1.0, 3.0}) {
    const std::vector<HandlePose> poses = {Pose({angle, 0.2, 0}, {1, 0, 2}, 1.2),
                                           Pose({0, -angle, 0.1}, {0, 0.5, -1})};
    const auto direct = SolveLinearElasticDirectly(preparation.get(), poses);
    ASSERT_THAT(direct, IsOk());
    const Positions answer = deformer->Deform(poses).value().positions;
    EXPECT_LT(LargestDifference(answer, direct->positions),
              1e-9 * preparation->mesh().BoundingBoxDiagonal());
    EXPECT_LT(direct->summary.residual, 1e-12);
  }
}

TEST(LinearElasticDeformerTest, LargeRotationPutsTheBoundaryExactlyWhereThePoseDoes) {
  const auto preparation = PrepareBar().value();
  const auto deformer = CreateLinearElasticDeformer(preparation).value();
  const HandlePose pose = Pose({0, 0, 2.5}, {1, 0, 0}, 1.3);
  const Deformation answer = deformer->Deform({pose}).value();
  EXPECT_LT(BoundaryError(*preparation, pose, 0, answer.positions), 1e-14 * 100);
  for (const int32_t v : preparation->constraints().fixed()) {
    EXPECT_EQ(answer.positions.row(v), preparation->mesh().positions().row(v));
  }
  EXPECT_TRUE(answer.summary.converged);
  EXPECT_EQ(answer.summary.load, 1.0);
}

TEST(LinearElasticDeformerTest, HandlesSuperpose) {
  const auto preparation = PrepareBar({}, 2).value();
  const auto deformer = CreateLinearElasticDeformer(preparation).value();
  const HandlePose first = Pose({0.1, 0.2, 0}, {1, 0, 2});
  const HandlePose second = Pose({0, -0.1, 0.1}, {0, 0.5, -1});
  const Positions& rest = preparation->mesh().positions();
  const Positions both = deformer->Deform({first, second}).value().positions;
  const Positions one = deformer->Deform({first, HandlePose{}}).value().positions;
  const Positions other = deformer->Deform({HandlePose{}, second}).value().positions;
  EXPECT_LT(LargestDifference(both, one + other - rest), 1e-12);
}

TEST(LinearElasticDeformerTest, StiffnessScaleDoesNotMatterPoissonRatioDoes) {
  const HandlePose pose = Pose({0, 0, 0}, {0, 0, 2});
  const auto answer = [&pose](double nu) {
    PreparationOptions options;
    options.poisson_ratio = nu;
    const auto deformer = CreateLinearElasticDeformer(PrepareBar(options).value()).value();
    return deformer->Deform({pose}).value().positions;
  };
  // Pulled, the middle gets slimmer by Poisson's ratio alone.
  const auto width = [](const Positions& x) { return x.col(0).segment(80, 20).maxCoeff(); };
  EXPECT_GT(width(answer(0.0)), width(answer(0.45)) + 0.1);
}

}  // namespace
}  // namespace tissueform
