// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/answer_evaluator/answer_evaluator.h"

#include <limits>
#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

#include "gtest/gtest.h"

#include "core/mechanics/answer_evaluator/answer_bytes.h"
#include "core/mechanics/answer_evaluator/answer_checks.h"
#include "core/mesh/tet_topology.h"
#include "core/planning/plan_io.h"
#include "tests/core/mechanics/answer_evaluator/evaluated_problem.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

struct Problem {
  std::shared_ptr<MeshPreparation> preparation;
  std::vector<int32_t> vertices;
};

TEST(AnswerSizeTest, AHeadWithThreeSegmentsTravelsInAFewMegabytes) {
  const PlanProblem plan = *ResolvePlan(*ReadPlan(TestDataPath("plans/three_segments/plan.json")));
  const Problem problem{*MeshPreparation::Create(*plan.mesh, plan.stiffness, plan.constraints, {}),
                        BoundaryVertices(*plan.mesh)};
  for (const auto& [model, most_bytes] : {std::pair(DeformationModel::kGradientField, 2500000),
                                          std::pair(DeformationModel::kLinearElastic, 4000000)}) {
    ASSERT_OK_AND_ASSIGN(const auto response,
                         CreateResponse(problem.preparation, problem.vertices, {.model = model}));
    const auto bytes = static_cast<int64_t>(WriteAnswers(response->Describe()).size());
    EXPECT_LT(bytes, most_bytes) << NameOf(model);
    // Little beside what is held: how the vertices are divided, and some numbers.
    EXPECT_LT(bytes, response->bytes_held() + 6 * static_cast<int64_t>(problem.vertices.size()));
  }
}

class EvaluatedModelTest : public ::testing::TestWithParam<Evaluated> {
 protected:
  const TetMesh bar_ = Bar({4, GetParam().num_handles == 2 ? 6 : 4, 8}, 2.0, 0.2);
  const Problem problem_{PrepareEvaluated(bar_, GetParam()), AllVertices(bar_)};
  const std::unique_ptr<VertexResponse> response_ =
      *CreateResponse(problem_.preparation, problem_.vertices, {.model = GetParam().model});
};

TEST_P(EvaluatedModelTest, IdentityGivesRest) {
  const AnswerEvaluator evaluator(response_->Describe());
  std::vector<float> positions;
  ASSERT_TRUE(evaluator.Answer(std::vector<AnswerPose>(GetParam().num_handles), &positions));
  const FloatPositions rest = problem_.preparation->mesh().positions().cast<float>();
  EXPECT_EQ(Eigen::Map<const FloatPositions>(positions.data(), rest.rows(), 3), rest);
}

TEST_P(EvaluatedModelTest, ChosenVerticesAreWhereTheWholeAnswerHasThem) {
  const AnswerEvaluator evaluator(response_->Describe());
  std::vector<AnswerPose> poses(GetParam().num_handles);
  poses[0].translation_mm = {0.3, -0.2, 0.1};
  poses[0].rotation_vector = {0.02, 0.01, -0.03};
  std::vector<float> positions;
  ASSERT_TRUE(evaluator.Answer(poses, &positions));
  const auto count = static_cast<int32_t>(positions.size() / 3);
  std::vector<int32_t> vertices;  // of all kinds, not in their order, one of them twice
  vertices.reserve(static_cast<size_t>(count) + 1);
  for (int32_t v = 0; v < count; ++v) vertices.push_back((v * 7 + 3) % count);
  vertices.push_back(vertices[0]);
  const std::vector<ChosenVertex> chosen = evaluator.Choose(vertices);
  std::vector<float> of_chosen(3 * chosen.size());
  ASSERT_TRUE(AnswerAt(evaluator, poses, chosen, of_chosen.data()));
  for (size_t i = 0; i < vertices.size(); ++i) {
    for (size_t axis = 0; axis < 3; ++axis) {
      EXPECT_EQ(of_chosen[3 * i + axis], positions[3 * static_cast<size_t>(vertices[i]) + axis]);
    }
  }
  poses[0].scale = 0;
  EXPECT_FALSE(AnswerAt(evaluator, poses, chosen, of_chosen.data()));
}

TEST_P(EvaluatedModelTest, InvalidPosesAreNotCovered) {
  const AnswerEvaluator evaluator(response_->Describe());
  std::vector<float> positions = {1, 2, 3};
  const auto handles = static_cast<size_t>(GetParam().num_handles);
  std::vector<AnswerPose> poses(handles);
  ASSERT_TRUE(evaluator.Covers(poses));
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(),
                           std::numeric_limits<double>::infinity(), 1e300, -1e300}) {
    poses.back().scale = bad;
    EXPECT_FALSE(evaluator.Answer(poses, &positions)) << bad;
    poses.back() = {};
    poses.back().rotation_vector[2] = bad;
    EXPECT_FALSE(evaluator.Answer(poses, &positions)) << bad;
    poses.back() = {};
    poses.back().translation_mm[0] = bad;
    EXPECT_FALSE(evaluator.Answer(poses, &positions)) << bad;
    poses.back() = {};
  }
  EXPECT_FALSE(evaluator.Covers(std::vector<AnswerPose>(handles - 1)));
  EXPECT_FALSE(evaluator.Covers(std::vector<AnswerPose>(handles + 1)));
  EXPECT_FALSE(evaluator.Covers({}));
  EXPECT_EQ(positions, (std::vector<float>{1, 2, 3})) << "nothing is written";
}

TEST_P(EvaluatedModelTest, SizesThatDoNotFitAreFound) {
  const PortableAnswers answers = response_->Describe();
  ASSERT_EQ(CheckAnswers(answers), "");
  int sections = 0;
  // One value more or less of anything that is there.
  VisitSections(answers, [&](uint32_t number, const auto& values) {
    if (values.empty()) return;
    ++sections;
    for (const bool more : {true, false}) {
      PortableAnswers other = answers;
      VisitSections(other, [&](uint32_t of_other, auto& changed) {
        if (of_other == number) changed.resize(changed.size() + (more ? 1 : -1));
      });
      EXPECT_NE(CheckAnswers(other), "") << number << (more ? ", longer" : ", shorter");
    }
  });
  EXPECT_GE(sections, 9);
}

TEST_P(EvaluatedModelTest, NonFiniteNumbersAreFound) {
  const PortableAnswers answers = response_->Describe();
  VisitSections(answers, [&](uint32_t number, const auto& values) {
    using Value = typename std::remove_cvref_t<decltype(values)>::value_type;
    if constexpr (std::is_floating_point_v<Value>) {
      if (values.empty()) return;
      PortableAnswers other = answers;
      VisitSections(other, [&](uint32_t of_other, auto& changed) {
        using Changed = typename std::remove_cvref_t<decltype(changed)>::value_type;
        if constexpr (std::is_same_v<Value, Changed>) {
          if (of_other == number) changed.back() = std::numeric_limits<Value>::quiet_NaN();
        }
      });
      EXPECT_NE(CheckAnswers(other), "") << number;
    }
  });
  PortableAnswers other = answers;
  other.regions.back() = 2;
  EXPECT_NE(CheckAnswers(other), "");
  other = answers;
  other.numbers.num_handles = 1.5;
  EXPECT_NE(CheckAnswers(other), "");
  other = answers;
  other.numbers.model = 4;
  EXPECT_NE(CheckAnswers(other), "");
  other = answers;
  other.numbers.tolerance_mm = -1;
  EXPECT_NE(CheckAnswers(other), "");
  if (GetParam().model == DeformationModel::kNeoHookean) {
    other = answers;
    other.cluster_vertices[0] = other.cluster_vertices[1];
    EXPECT_NE(CheckAnswers(other), "");
    other = answers;
    other.clusters[1] = -1;
    EXPECT_NE(CheckAnswers(other), "");
  }
}

INSTANTIATE_TEST_SUITE_P(Models, EvaluatedModelTest, ::testing::ValuesIn(EvaluatedModels()),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace tissueform::testing
