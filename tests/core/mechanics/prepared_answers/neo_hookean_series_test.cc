// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/neo_hookean_series.h"

#include <numbers>
#include <string>
#include <vector>

#include "gtest/gtest.h"

#include "core/mechanics/answer_evaluator/series_terms.h"
#include "core/mechanics/deformation/neo_hookean_deformer.h"
#include "core/mechanics/elasticity/neo_hookean_expansion.h"
#include "core/mechanics/prepared_answers/pose_samples.h"
#include "core/mechanics/prepared_answers/vertex_response.h"
#include "core/planning/plan_io.h"
#include "tests/testing/handle_problem.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

namespace tissueform {
namespace {

using testing::RandomNumbers;

std::shared_ptr<MeshPreparation> OneTet() {
  const TetMesh mesh = testing::SingleTet();
  const ConstraintSet constraints = *ConstraintSet::Create(mesh, {0, 2}, {{"top", {3}}});
  return *MeshPreparation::Create(mesh, testing::MixedStiffness(1), constraints, {});
}

std::shared_ptr<MeshPreparation> JitteredBar() {
  return testing::PrepareMesh(testing::Bar({4, 4, 8}, 2.0, 0.2), 1);
}

std::shared_ptr<MeshPreparation> Tongue() {
  return testing::PrepareMesh(testing::LoadTestMesh("meshes/tet_sofa_tongue/volumetricTongue.vtu"),
                              1);
}

std::shared_ptr<MeshPreparation> Head() {
  const PlanProblem plan =
      *ResolvePlan(*ReadPlan(testing::TestDataPath("plans/head_chin/plan.json")));
  return *MeshPreparation::Create(*plan.mesh, plan.stiffness, plan.constraints, {});
}

struct Body {
  const char* name;
  std::shared_ptr<MeshPreparation> (*prepare)();
  double size;  // of the poses: of a turn by 1 rad and a move by the mesh's size
};

class NeoHookeanSeriesTest : public ::testing::TestWithParam<Body> {
 protected:
  NeoHookeanSeriesTest()
      : preparation_(GetParam().prepare()),
        elastic_(**preparation_->Elastic()),
        vertices_(testing::AllVertices(preparation_->mesh())),
        series_(*MakeNeoHookeanSeries(*preparation_, elastic_, vertices_, {}, {})),
        deformer_(*CreateNeoHookeanDeformer(preparation_, {.tolerance = 1e-9})) {}

  // About the handle's middle, so that the numbers are odd in the pose.
  HandlePose PoseOfSize(double size, const Eigen::Vector3d& turn, const Eigen::Vector3d& move) {
    HandlePose pose;
    pose.pivot_mm = HandleCentroids(*preparation_).front();
    pose.rotation_vector = size * turn;
    pose.translation_mm = size * preparation_->mesh().BoundingBoxDiagonal() * move;
    return pose;
  }

  Eigen::VectorXd Converged(const HandlePose& pose) {
    const Deformation answer = *deformer_->Deform({pose});
    return (answer.positions - preparation_->mesh().positions()).reshaped<Eigen::RowMajor>();
  }

  // Of the converged answers to a pose and its opposite the part that is odd, without the linear
  // system's own; and what the columns say that it is, to fifth order.
  Eigen::VectorXd OddPart(const HandlePose& pose, const HandlePose& opposite) {
    const Eigen::VectorXd linear =
        elastic_.response_columns() *
        (elastic_.Coefficients(std::vector{pose}) - elastic_.Coefficients(std::vector{opposite}));
    return 0.5 * (Converged(pose) - Converged(opposite) - linear);
  }
  Eigen::VectorXd ThirdOrder(const HandlePose& pose) {
    PortableAnswers answers;
    const Eigen::Vector3d centroid = HandleCentroids(*preparation_).front();
    answers.centroids.assign(centroid.begin(), centroid.end());
    const std::vector<double> list = NumbersOf(answers, ToAnswerPoses({pose}));
    const Eigen::Map<const Eigen::VectorXd> n(list.data(), kNumbersPerHandle);
    return series_.columns.rightCols(SeriesSizes(*preparation_).triples) * TripleProducts(n);
  }

  const std::shared_ptr<MeshPreparation> preparation_;
  const ElasticSystem& elastic_;
  const std::vector<int32_t> vertices_;
  const NeoHookeanSeries series_;
  const std::unique_ptr<Deformer> deformer_;
};

TEST_P(NeoHookeanSeriesTest, ThirdOrderIsTheThirdDifferenceOfConvergedAnswers) {
  RandomNumbers random(5);
  for (int sample = 0; sample < 2; ++sample) {
    const Eigen::Vector3d turn = random.Vector().normalized();
    const Eigen::Vector3d move = random.Vector().normalized();
    const auto off = [&](double size) {
      const HandlePose pose = PoseOfSize(size, turn, move);
      const Eigen::VectorXd third = ThirdOrder(pose);
      return (OddPart(pose, PoseOfSize(-size, turn, move)) - third).norm() / third.norm();
    };
    const double far = off(GetParam().size);
    EXPECT_LT(off(0.5 * GetParam().size), 0.1);
    EXPECT_NEAR(far / off(0.5 * GetParam().size), 4, 1) << "what is left is of fifth order";
  }
}

TEST_P(NeoHookeanSeriesTest, ConstrainedVerticesAreMovedByTheLinearColumnsAlone) {
  const SeriesSizes sizes(*preparation_);
  for (const int32_t v : preparation_->constraints().constrained()) {
    EXPECT_EQ(series_.columns.middleRows<3>(3 * Eigen::Index{v})
                  .rightCols(sizes.pairs + sizes.triples)
                  .norm(),
              0);
  }
}

INSTANTIATE_TEST_SUITE_P(Bodies, NeoHookeanSeriesTest,
                         ::testing::Values(Body{"OneTet", OneTet, 0.04},
                                           Body{"JitteredBar", JitteredBar, 0.02},
                                           Body{"Tongue", Tongue, 0.02}, Body{"Head", Head, 0.005}),
                         [](const auto& test) { return test.param.name; });

TEST(NeoHookeanSeriesSizesTest, SeveralHandlesEndWithTheSecondOrder) {
  const auto preparation = testing::PrepareMesh(testing::Bar({4, 6, 8}, 2.0, 0.2), 2);
  const SeriesSizes sizes(*preparation);
  EXPECT_EQ(sizes.triples, 0);
  EXPECT_EQ(sizes.columns(), 24 + 78);
  ASSERT_OK_AND_ASSIGN(const ElasticSystem* elastic, preparation->Elastic());
  ASSERT_OK_AND_ASSIGN(const NeoHookeanSeries series,
                       MakeNeoHookeanSeries(*preparation, *elastic, {3, 1}, {}, {}));
  EXPECT_EQ(series.columns.cols(), sizes.columns());
  EXPECT_EQ(series.columns.rows(), 6);
  EXPECT_TRUE(series.second_lengths.empty());
  EXPECT_TRUE(series.third_lengths.empty());
}

}  // namespace
}  // namespace tissueform
