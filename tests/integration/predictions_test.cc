// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/error_reason.h"
#include "core/base/software_version.h"
#include "core/mesh/tet_topology.h"
#include "tests/integration/service_test.h"
#include "tests/testing/status_matchers.h"

// Answers that the server keeps, over the network.
namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

class PredictionsTest : public ServiceTest {
 protected:
  PredictionsTest() : client_(Connect()), session_(MakeSession(client_.get(), problem_)) {}

  PredictionCalls& calls() { return client_->predictions(); }
  absl::StatusOr<v1::Prediction> Predict(int pose, v1::DeformationModel model = {}) {
    return calls().Create(session_.name(), TopPose(SomePose(pose)), model);
  }

  const BarProblem problem_{7};
  const std::unique_ptr<TissueformClient> client_;
  const v1::Session session_;
};

TEST_F(PredictionsTest, APredictionIsTheAnswerWithAllThatWasAsked) {
  ASSERT_OK_AND_ASSIGN(const v1::Prediction made, Predict(2, v1::DEFORMATION_MODEL_NEO_HOOKEAN));
  ASSERT_OK_AND_ASSIGN(const v1::DeformOnceResponse answer,
                       client_->DeformOnce(session_.name(), TopPose(SomePose(2)), {},
                                           v1::DEFORMATION_MODEL_NEO_HOOKEAN));
  ASSERT_OK_AND_ASSIGN(const v1::Prediction kept, calls().Get(made.name()));
  EXPECT_EQ(kept.DebugString(), made.DebugString());
  ASSERT_OK_AND_ASSIGN(const Positions positions, calls().ReadPositions(made.name()));
  ASSERT_OK_AND_ASSIGN(const Positions expected,
                       DecodePositions(answer.positions(), problem_.mesh.num_vertices()));
  EXPECT_EQ(positions, expected);
  EXPECT_EQ(kept.session(), session_.name());
  EXPECT_EQ(kept.mesh(), session_.mesh());
  EXPECT_EQ(kept.vertex_count(), problem_.mesh.num_vertices());
  EXPECT_EQ(kept.model(), v1::DEFORMATION_MODEL_NEO_HOOKEAN);
  EXPECT_EQ(kept.stiffness().cell_array(), "youngs_modulus_pa");
  EXPECT_EQ(kept.poisson_ratio(), session_.poisson_ratio());
  EXPECT_EQ(kept.summary().iterations(), answer.summary().iterations());
  EXPECT_EQ(kept.quality().DebugString(), answer.quality().DebugString());
  EXPECT_EQ(kept.software_version(), SoftwareVersion());
  ASSERT_EQ(kept.poses_size(), 1);
  EXPECT_EQ(kept.poses(0).handle(), "top");
  EXPECT_EQ(kept.poses(0).translation_mm().x(), SomePose(2).translation_mm.x());
  EXPECT_GE(kept.create_time().seconds(), session_.create_time().seconds());
}

TEST_F(PredictionsTest, TheSameRequestFromManyAtOnceIsOnePrediction) {
  std::vector<std::string> names(4);
  std::vector<std::thread> threads;
  threads.reserve(names.size());
  for (std::string& name : names) {
    threads.emplace_back([&] {
      const auto made = calls().Create(session_.name(), TopPose(SomePose(1)), {}, "one");
      if (made.ok()) name = made->name();
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_NE(names[0], "");
  EXPECT_THAT(names, ::testing::Each(names[0]));
  ASSERT_OK_AND_ASSIGN(const auto all, calls().List());
  EXPECT_EQ(all.size(), 1U);
}

TEST_F(PredictionsTest, CaseAndTitleAreKeptAndListedBy) {
  const std::string of_one = "cases/" + std::string(64, 'a');
  const auto create = [&](const PredictionLabel& label, const std::string& request_id = "") {
    return calls().Create(session_.name(), TopPose(SomePose(1)), {}, request_id, label);
  };
  ASSERT_OK_AND_ASSIGN(const v1::Prediction made,
                       create({.case_name = of_one, .title = "Kinn 8 mm vor, \u00fcber alles"}));
  EXPECT_EQ(made.case_(), of_one);
  EXPECT_EQ(made.title(), "Kinn 8 mm vor, \u00fcber alles");
  ASSERT_OK_AND_ASSIGN(const v1::Prediction kept, calls().Get(made.name()));
  EXPECT_EQ(kept.DebugString(), made.DebugString());
  ASSERT_OK_AND_ASSIGN(const v1::Prediction plain, Predict(2));
  EXPECT_EQ(plain.case_(), "");
  EXPECT_EQ(plain.title(), "");
  ASSERT_OK_AND_ASSIGN(std::vector<v1::Prediction> listed, calls().List("", of_one));
  ASSERT_EQ(listed.size(), 1U);
  EXPECT_EQ(listed[0].DebugString(), made.DebugString());
  ASSERT_OK_AND_ASSIGN(listed, calls().List(session_.name(), "cases/" + std::string(64, 'b')));
  EXPECT_THAT(listed, IsEmpty());
  // The title is part of the request.
  ASSERT_THAT(create({.title = "a"}, "one"), IsOk());
  EXPECT_THAT(create({.title = "b"}, "one"), Because(ErrorReason::kRequestIdReused));
}

TEST_F(PredictionsTest, RefusesAnInvalidCaseOrTitle) {
  const auto refused = [&](const PredictionLabel& label, const std::string& why) {
    EXPECT_THAT(calls().Create(session_.name(), TopPose(SomePose(1)), {}, "", label),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(why)));
  };
  refused({.case_name = "cases/of a patient"}, "invalid case name");
  refused({.case_name = session_.mesh()}, "invalid case name");
  refused({.title = std::string(257, 'x')}, "256");
  refused({.title = "\x1b[2J"}, "control character");
  EXPECT_THAT(calls().List("", "cases/none"), StatusIs(absl::StatusCode::kInvalidArgument));
  ASSERT_OK_AND_ASSIGN(const auto all, calls().List());
  EXPECT_THAT(all, IsEmpty());
}

TEST_F(PredictionsTest, ComparesTwoByTheDistancesOfTheirVertices) {
  ASSERT_OK_AND_ASSIGN(const v1::Prediction one, Predict(1));
  ASSERT_OK_AND_ASSIGN(const v1::Prediction other, Predict(4));
  ASSERT_OK_AND_ASSIGN(const ComparedPredictions compared,
                       calls().Compare(one.name(), other.name(), true));
  ASSERT_OK_AND_ASSIGN(const Positions from, calls().ReadPositions(one.name()));
  ASSERT_OK_AND_ASSIGN(const Positions to, calls().ReadPositions(other.name()));
  EXPECT_LT((compared.differences - (to - from)).cwiseAbs().maxCoeff(), 1e-6);
  const Eigen::VectorXd distances = (to - from).rowwise().norm();
  const v1::DistanceStatistics& reported = compared.comparison.distances();
  EXPECT_EQ(reported.vertex_count(), problem_.mesh.num_vertices());
  EXPECT_NEAR(reported.mean_mm(), distances.mean(), 1e-12);
  EXPECT_EQ(reported.max_mm(), distances.maxCoeff());
  EXPECT_EQ(distances[reported.worst_vertex()], reported.max_mm());
  EXPECT_LE(reported.p50_mm(), reported.p95_mm());
  EXPECT_LE(reported.p95_mm(), reported.max_mm());
  EXPECT_EQ(compared.comparison.other_prediction(), other.name());
  EXPECT_EQ(compared.comparison.other_quality().DebugString(), other.quality().DebugString());
  EXPECT_EQ(one.recipe_sha256(), other.recipe_sha256());

  ASSERT_OK_AND_ASSIGN(const ComparedPredictions same, calls().Compare(one.name(), one.name()));
  EXPECT_EQ(same.comparison.distances().max_mm(), 0);
  EXPECT_EQ(same.differences.size(), 0);
}

TEST_F(PredictionsTest, ComparesWithAnotherModelAsWithItsPrediction) {
  ASSERT_OK_AND_ASSIGN(const v1::Prediction one, Predict(3));
  ASSERT_OK_AND_ASSIGN(const v1::Prediction elastic,
                       Predict(3, v1::DEFORMATION_MODEL_LINEAR_ELASTIC));
  ASSERT_OK_AND_ASSIGN(const ComparedPredictions by_name,
                       calls().Compare(one.name(), elastic.name(), true));
  ASSERT_OK_AND_ASSIGN(const ComparedPredictions by_model,
                       calls().Compare(one.name(), v1::DEFORMATION_MODEL_LINEAR_ELASTIC, true));
  EXPECT_GT(by_name.comparison.distances().max_mm(), 0.01);
  EXPECT_EQ(by_model.differences, by_name.differences);
  EXPECT_EQ(by_model.comparison.distances().DebugString(),
            by_name.comparison.distances().DebugString());
  EXPECT_EQ(by_model.comparison.other_model(), v1::DEFORMATION_MODEL_LINEAR_ELASTIC);
  EXPECT_EQ(by_model.comparison.other_prediction(), "");
  // The own model has nothing to add.
  ASSERT_OK_AND_ASSIGN(const ComparedPredictions same,
                       calls().Compare(one.name(), v1::DEFORMATION_MODEL_GRADIENT_FIELD));
  EXPECT_EQ(same.comparison.distances().max_mm(), 0);
}

TEST_F(PredictionsTest, ComparesTheSkinOrListedVerticesOnly) {
  ASSERT_OK_AND_ASSIGN(const v1::Prediction one, Predict(1));
  ASSERT_OK_AND_ASSIGN(const v1::Prediction other, Predict(4));
  ASSERT_OK_AND_ASSIGN(const Positions from, calls().ReadPositions(one.name()));
  ASSERT_OK_AND_ASSIGN(const Positions to, calls().ReadPositions(other.name()));
  const Positions moved = to - from;
  using Kind = AnswerVertices::Kind;
  const std::vector<int32_t> skin = BoundaryVertices(problem_.mesh);
  ASSERT_LT(skin.size(), moved.rows());
  for (const AnswerVertices& asked :
       {AnswerVertices{Kind::kSkin, {}}, AnswerVertices{Kind::kList, {40, 3, 77}}}) {
    const std::vector<int32_t>& vertices = asked.kind == Kind::kSkin ? skin : asked.list;
    ASSERT_OK_AND_ASSIGN(const ComparedPredictions compared,
                         calls().Compare(one.name(), other.name(), true, asked));
    const Positions expected = moved(vertices, Eigen::all);
    ASSERT_EQ(compared.differences.rows(), expected.rows());
    EXPECT_LT((compared.differences - expected).cwiseAbs().maxCoeff(), 1e-6);
    const Eigen::VectorXd distances = expected.rowwise().norm();
    const v1::DistanceStatistics& reported = compared.comparison.distances();
    EXPECT_EQ(reported.vertex_count(), vertices.size());
    EXPECT_NEAR(reported.mean_mm(), distances.mean(), 1e-12);
    EXPECT_EQ(reported.max_mm(), distances.maxCoeff());
    EXPECT_EQ(moved.row(reported.worst_vertex()).norm(), reported.max_mm())
        << "numbered as in the mesh";
    EXPECT_THAT(vertices, ::testing::Contains(reported.worst_vertex()));
    ASSERT_OK_AND_ASSIGN(const ComparedPredictions by_model,
                         calls().Compare(one.name(), one.model(), true, asked));
    EXPECT_EQ(by_model.comparison.distances().vertex_count(), vertices.size());
    EXPECT_EQ(by_model.comparison.distances().max_mm(), 0);
  }
}

TEST_F(PredictionsTest, VerticesThatCannotBeComparedAreRefused) {
  ASSERT_OK_AND_ASSIGN(const v1::Prediction one, Predict(1));
  const auto compare = [&](AnswerVertices::Kind kind, std::vector<int32_t> list) {
    return calls().Compare(one.name(), one.name(), false, {kind, std::move(list)});
  };
  using Kind = AnswerVertices::Kind;
  const auto count = static_cast<int32_t>(problem_.mesh.num_vertices());
  for (const std::vector<int32_t>& list :
       {std::vector<int32_t>{}, {-1}, {count}, {5, 5}, std::vector<int32_t>(count + 1, 0)}) {
    EXPECT_THAT(compare(Kind::kList, list), StatusIs(absl::StatusCode::kInvalidArgument));
  }
  // What is skin only the mesh knows; numbers need none.
  ASSERT_THAT(client_->DeleteSession(session_.name()), IsOk());
  ASSERT_THAT(client_->DeleteMesh(session_.mesh()), IsOk());
  EXPECT_THAT(compare(Kind::kSkin, {}), Because(ErrorReason::kMeshNotFound));
  EXPECT_THAT(compare(Kind::kList, {5}), IsOk());
}

// What is named must be of one mesh and its session still that of before.
TEST_F(PredictionsTest, RefusesToCompareDifferentMeshesAndChangedSessions) {
  ASSERT_OK_AND_ASSIGN(const v1::Prediction one, Predict(1));
  const BarProblem other(8);
  const v1::Session of_other = MakeSession(client_.get(), other);
  ASSERT_OK_AND_ASSIGN(const v1::Prediction on_other_mesh,
                       calls().Create(of_other.name(), TopPose(SomePose(1))));
  const auto of_other_mesh = calls().Compare(one.name(), on_other_mesh.name());
  EXPECT_THAT(of_other_mesh, StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("meshes")));
  EXPECT_THAT(of_other_mesh, Because(ErrorReason::kNotComparable));
  EXPECT_THAT(calls().Compare(one.name(), static_cast<v1::DeformationModel>(99)),
              StatusIs(absl::StatusCode::kInvalidArgument));

  SessionRequest request = problem_.Request(session_.mesh());
  request.session_id = "a-session-that-changes";
  request.stiffness = 1000.0;
  ASSERT_OK_AND_ASSIGN(const v1::Session before, client_->CreateSession(request));
  ASSERT_OK_AND_ASSIGN(const v1::Prediction made,
                       calls().Create(before.name(), TopPose(SomePose(1))));
  std::vector<SessionRequest> changed(3, request);
  changed[0].fixed.pop_back();
  changed[1].handles[0].name = "cap";
  changed[2].mesh = of_other.mesh();  // which has as many vertices
  for (const SessionRequest& now : changed) {
    ASSERT_THAT(client_->DeleteSession(before.name()), IsOk());
    ASSERT_THAT(client_->CreateSession(now), IsOk());
    EXPECT_THAT(calls().Compare(made.name(), v1::DEFORMATION_MODEL_ARAP),
                Because(ErrorReason::kNotComparable));
  }
}

TEST_F(PredictionsTest, BadRequestsAreRefusedAndLeaveNothing) {
  EXPECT_THAT(calls().Create("none", TopPose(SomePose(1))),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("session")));
  EXPECT_THAT(calls().Create(session_.name(), {}), StatusIs(absl::StatusCode::kInvalidArgument));
  for (const std::string name : {"", "predictions/", "predictions/a b", "sessions/none"}) {
    EXPECT_THAT(calls().Get(name),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("prediction")));
    EXPECT_THAT(calls().Delete(name), StatusIs(absl::StatusCode::kInvalidArgument));
    EXPECT_THAT(calls().ReadPositions(name), StatusIs(absl::StatusCode::kInvalidArgument));
  }
  ASSERT_OK_AND_ASSIGN(const auto all, calls().List());
  EXPECT_THAT(all, IsEmpty());
}

TEST_F(PredictionsTest, PositionsComeFromAnyOffset) {
  ASSERT_OK_AND_ASSIGN(const v1::Prediction made, Predict(1));
  ASSERT_OK_AND_ASSIGN(const Positions positions, calls().ReadPositions(made.name()));
  const std::string whole =
      EncodePositions(positions, {}, v1::POSITION_ENCODING_FLOAT32, positions).bytes;
  const auto stub = v1::PredictionService::NewStub(OwnChannel());
  const auto read = [&](int64_t offset, std::string* bytes) {
    grpc::ClientContext context;
    v1::ReadPositionsRequest request;
    request.set_name(made.name());
    request.set_read_offset(offset);
    const auto reader = stub->ReadPositions(&context, request);
    v1::ReadPositionsResponse response;
    while (reader->Read(&response)) {
      EXPECT_EQ(response.chunk().offset(), offset + static_cast<int64_t>(bytes->size()));
      EXPECT_EQ(response.chunk().total_bytes(), static_cast<int64_t>(whole.size()));
      *bytes += response.chunk().data();
    }
    return reader->Finish().error_code();
  };
  const auto size = static_cast<int64_t>(whole.size());
  for (const int64_t offset : {int64_t{0}, int64_t{1001}, size - 1, size}) {
    std::string bytes;
    EXPECT_EQ(read(offset, &bytes), grpc::StatusCode::OK);
    EXPECT_TRUE(bytes == whole.substr(offset)) << offset;
  }
  for (const int64_t offset : {int64_t{-1}, size + 1}) {
    std::string bytes;
    EXPECT_EQ(read(offset, &bytes), grpc::StatusCode::INVALID_ARGUMENT);
    EXPECT_EQ(bytes, "");
  }
}

}  // namespace
}  // namespace tissueform::testing
