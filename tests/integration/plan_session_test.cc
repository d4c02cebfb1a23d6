// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/plan_session.h"

#include <memory>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mechanics/deformation/create_deformer.h"
#include "tests/integration/service_test.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

class PlanSessionTest : public ServiceTest {
 protected:
  static PlanProblem ProblemOf(const BarProblem& bar) {
    return {.mesh = std::make_shared<const TetMesh>(bar.mesh),
            .point_data = {},
            .cell_data = {},
            .written_in = CoordinateSystem::kLps,
            .stiffness = bar.stiffness,
            .constraints = bar.constraints,
            .poses = {SomePose(3)},
            .deformer = {},
            .uncertainty = {}};
  }
};

TEST_F(PlanSessionTest, AnswersAsADeformerOfTheProblemInThisProcess) {
  const auto client = Connect();
  PlanProblem problem = ProblemOf(BarProblem(4));
  problem.deformer.preparation.poisson_ratio = 0.4;
  for (const DeformationModel model : {DeformationModel::kGradientField, DeformationModel::kArap,
                                       DeformationModel::kLinearElastic}) {
    problem.deformer.model = model;
    ASSERT_OK_AND_ASSIGN(const auto session, PlanSession::Create(client.get(), problem));
    ASSERT_OK_AND_ASSIGN(const v1::DeformOnceResponse answer,
                         client->DeformOnce(session->name(), NamedPoses(problem)));
    ASSERT_OK_AND_ASSIGN(const Positions served,
                         DecodePositions(answer.positions(), problem.mesh->num_vertices()));
    ASSERT_OK_AND_ASSIGN(
        const auto deformer,
        CreateDeformer(*problem.mesh, problem.stiffness, problem.constraints, problem.deformer));
    ASSERT_OK_AND_ASSIGN(const Deformation direct, deformer->Deform(problem.poses));
    EXPECT_LT((served - direct.positions).cwiseAbs().maxCoeff(), kFloat32Tolerance)
        << static_cast<int>(model);
  }
}

TEST_F(PlanSessionTest, TheSessionEndsWithItsObject) {
  const auto client = Connect();
  std::string name;
  {
    ASSERT_OK_AND_ASSIGN(const auto session,
                         PlanSession::Create(client.get(), ProblemOf(BarProblem(5))));
    name = session->name();
    EXPECT_THAT(client->GetSession(name).status(), IsOk());
  }
  EXPECT_THAT(client->GetSession(name).status(),
              StatusIs(absl::StatusCode::kNotFound, ::testing::_));
}

// The client's rule is the server's.
TEST_F(PlanSessionTest, StreamsArePreparedForTheModelsThatHavePreparedAnswers) {
  const auto client = Connect();
  PlanProblem problem = ProblemOf(BarProblem(6));
  std::vector<DeformerOptions> choices(7);
  choices[1].model = DeformationModel::kArap;
  choices[2].model = DeformationModel::kLinearElastic;
  choices[3].model = DeformationModel::kNeoHookean;
  choices[4].gradient_field.rotation = RotationMode::kEstimated;
  choices[5].gradient_field.rotation = RotationMode::kNone;
  choices[6].gradient_field.guidance = Guidance::kUniform;
  int prepared = 0;
  for (const DeformerOptions& options : choices) {
    problem.deformer = options;
    ASSERT_OK_AND_ASSIGN(const auto session, PlanSession::Create(client.get(), problem));
    DeformStream::Options stream;
    stream.vertices.kind = AnswerVertices::Kind::kSkin;
    stream.prepared.emplace();
    EXPECT_EQ(client->OpenStream(session->name(), stream).ok(),
              HasPreparedAnswers(options, problem.constraints))
        << static_cast<int>(options.model);
    prepared += HasPreparedAnswers(options, problem.constraints) ? 1 : 0;
  }
  EXPECT_EQ(prepared, 3);
}

}  // namespace
}  // namespace tissueform::testing
