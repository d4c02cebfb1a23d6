// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/answer_evaluator/answer_evaluator.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
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

Problem OfAllVertices(const TetMesh& mesh, int num_handles) {
  return {PrepareMesh(mesh, num_handles), AllVertices(mesh)};
}

Problem OneTet() {
  const TetMesh mesh = SingleTet();
  const ConstraintSet constraints = *ConstraintSet::Create(mesh, {0, 2}, {{"top", {3}}});
  return {*MeshPreparation::Create(mesh, MixedStiffness(1), constraints, {}), {3, 1, 0, 2, 1}};
}

Problem BarWithOneHandle() { return OfAllVertices(Bar({4, 4, 8}, 2.0, 0.2), 1); }
Problem BarWithTwoHandles() { return OfAllVertices(Bar({4, 6, 8}, 2.0, 0.2), 2); }
Problem BarWithThreeHandles() { return OfAllVertices(Bar({4, 6, 8}, 2.0, 0.2), 3); }

Problem Tongue() {
  return OfAllVertices(LoadTestMesh("meshes/tet_sofa_tongue/volumetricTongue.vtu"), 1);
}

Problem OfPlan(const std::string& name) {
  const PlanProblem plan = *ResolvePlan(*ReadPlan(TestDataPath("plans/" + name + "/plan.json")));
  return {*MeshPreparation::Create(*plan.mesh, plan.stiffness, plan.constraints, {}),
          BoundaryVertices(*plan.mesh)};
}

Problem Head() { return OfPlan("head"); }

struct Place {
  const char* name;
  Problem (*problem)();
};

class AnswerEvaluatorTest : public ::testing::TestWithParam<std::tuple<Place, DeformationModel>> {
 protected:
  DeformationModel model() const { return std::get<1>(GetParam()); }
};

// As bytes and back, over 1,000 random poses. Covered by one and not by the other would be poses
// whose error is the limit to the last digit.
TEST_P(AnswerEvaluatorTest, GivesWhatTheResponseGives) {
  const Problem problem = std::get<0>(GetParam()).problem();
  ASSERT_OK_AND_ASSIGN(const auto response,
                       CreateResponse(problem.preparation, problem.vertices, {.model = model()}));
  AnswerReading reading = ReadAnswers(WriteAnswers(response->Describe()));
  ASSERT_EQ(reading.error, AnswerError::kNone) << reading.message;
  const AnswerEvaluator evaluator(std::move(reading.answers));
  RandomNumbers random(12);
  FloatPositions expected;
  std::vector<float> positions;
  int covered = 0;
  for (int sample = 0; sample < 1000; ++sample) {
    const auto poses = DragPoses(*problem.preparation, model(), sample, &random);
    const auto answer_poses = ToAnswerPoses(poses);
    const std::optional<double> bound_mm = response->Answer(poses, &expected);
    double error_mm = 0;
    ASSERT_EQ(evaluator.Answer(answer_poses, &positions, &error_mm), bound_mm.has_value());
    if (!bound_mm.has_value()) continue;
    ++covered;
    // It reads all columns, the response as much as the tolerance needs. What was cut the response
    // multiplies in single precision, where large factors cancel.
    EXPECT_LE(error_mm, *bound_mm * (1 + 1e-3) + 1e-9);
    ASSERT_EQ(positions.size(), static_cast<size_t>(expected.size()));
    const double allowed = 1e-4 + (response->error_is_estimate() ? 0 : *bound_mm);
    const auto given = Eigen::Map<const FloatPositions>(positions.data(), expected.rows(), 3);
    ASSERT_LE((given - expected).rowwise().norm().maxCoeff(), allowed) << sample;
  }
  EXPECT_GT(covered, 100);
}

INSTANTIATE_TEST_SUITE_P(
    Problems, AnswerEvaluatorTest,
    ::testing::Combine(::testing::Values(Place{"OneTet", OneTet},
                                         Place{"BarWithOneHandle", BarWithOneHandle},
                                         Place{"BarWithTwoHandles", BarWithTwoHandles},
                                         Place{"BarWithThreeHandles", BarWithThreeHandles},
                                         Place{"Tongue", Tongue}, Place{"Head", Head}),
                       ::testing::Values(DeformationModel::kGradientField,
                                         DeformationModel::kLinearElastic,
                                         DeformationModel::kNeoHookean)),
    [](const auto& test) {
      return std::string(std::get<0>(test.param).name) + "_" + NameOf(std::get<1>(test.param));
    });

TEST(AnswerSizeTest, AHeadWithThreeSegmentsTravelsInAFewMegabytes) {
  const Problem problem = OfPlan("three_segments");
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
  const Problem problem_ = GetParam().num_handles == 2 ? BarWithTwoHandles() : BarWithOneHandle();
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

TEST_P(EvaluatedModelTest, PosesThatNobodyMayAskForAreNotCovered) {
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

TEST_P(EvaluatedModelTest, NumbersThatAreNoneAreFound) {
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
