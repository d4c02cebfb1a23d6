// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// Sessions and streams of several models on one preparation, and prepared answers.

#include <cmath>
#include <limits>
#include <optional>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mechanics/deformation/create_deformer.h"
#include "tests/integration/service_test.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;

constexpr double kPoissonRatio = 0.3;

v1::PreparedAnswers Prepared(double tolerance_mm, double max_rotation) {
  v1::PreparedAnswers prepared;
  prepared.set_tolerance_mm(tolerance_mm);
  prepared.set_max_rotation(max_rotation);
  return prepared;
}

HandlePose Turn(double angle_rad) {
  HandlePose pose;
  pose.rotation_vector = {0, 0, angle_rad};
  pose.translation_mm = {0.3, 0, 0.2};
  return pose;
}

class ModelsTest : public ServiceTest {
 protected:
  void SetUp() override {
    client_ = Connect();
    auto mesh = client_->UploadMesh(problem_.mesh, problem_.CellArrays());
    ASSERT_THAT(mesh, IsOk());
    request_ = problem_.Request(mesh->name());
    request_.poisson_ratio = kPoissonRatio;
    auto session = client_->CreateSession(request_);
    ASSERT_THAT(session, IsOk());
    session_ = *session;
  }

  Positions Solve(DeformationModel model, const HandlePose& pose) const {
    DeformerOptions options;
    options.model = model;
    options.preparation.poisson_ratio = kPoissonRatio;
    auto deformer =
        CreateDeformer(problem_.mesh, problem_.stiffness, problem_.constraints, options);
    return (*deformer)->Deform({pose})->positions;
  }

  // The largest distance of a frame's vertices, all of the mesh, from `expected`.
  double Distance(const std::string& bytes, const Positions& expected) const {
    auto positions = DecodePositions(bytes, problem_.mesh.num_vertices());
    EXPECT_THAT(positions, IsOk());
    return (*positions - expected).rowwise().norm().maxCoeff();
  }

  std::unique_ptr<DeformStream> Open(v1::DeformationModel model,
                                     std::optional<v1::PreparedAnswers> prepared) {
    DeformStream::Options options;
    options.model = model;
    options.prepared = std::move(prepared);
    auto stream = client_->OpenStream(session_.name(), options);
    EXPECT_THAT(stream, IsOk());
    return stream.ok() ? *std::move(stream) : nullptr;
  }

  const BarProblem problem_{1, {3, 3, 6}};
  std::unique_ptr<TissueformClient> client_;
  SessionRequest request_;
  v1::Session session_;
};

TEST_F(ModelsTest, OneSessionAnswersWithEveryModel) {
  const std::pair<v1::DeformationModel, DeformationModel> kModels[] = {
      {v1::DEFORMATION_MODEL_UNSPECIFIED, DeformationModel::kGradientField},
      {v1::DEFORMATION_MODEL_ARAP, DeformationModel::kArap},
      {v1::DEFORMATION_MODEL_LINEAR_ELASTIC, DeformationModel::kLinearElastic},
      {v1::DEFORMATION_MODEL_NEO_HOOKEAN, DeformationModel::kNeoHookean}};
  const HandlePose pose = Turn(0.2);
  for (const auto& [asked, model] : kModels) {
    ASSERT_OK_AND_ASSIGN(
        const v1::DeformOnceResponse answer,
        client_->DeformOnce(session_.name(), TopPose(pose), AnswerVertices{}, asked));
    EXPECT_LT(Distance(answer.positions(), Solve(model, pose)), kFloat32Tolerance) << asked;
    EXPECT_TRUE(answer.summary().converged()) << asked;
    EXPECT_EQ(answer.summary().load(), 1) << asked;
    EXPECT_GE(answer.summary().solve_seconds(), 0);
    EXPECT_GT(answer.quality().max_displacement_mm(), 0);
    EXPECT_GT(answer.quality().total_volume_ratio(), 0);
  }
  ASSERT_OK_AND_ASSIGN(const v1::Session after, client_->GetSession(session_.name()));
  EXPECT_GT(after.bytes_held(), session_.bytes_held()) << "more models hold more";
  EXPECT_EQ(after.model(), v1::DEFORMATION_MODEL_GRADIENT_FIELD) << "its own model stays";
}

TEST_F(ModelsTest, ASessionReturnsItsOwnModel) {
  request_.model = DeformationModel::kNeoHookean;
  ASSERT_OK_AND_ASSIGN(const v1::Session session, client_->CreateSession(request_));
  EXPECT_EQ(session.model(), v1::DEFORMATION_MODEL_NEO_HOOKEAN);
  EXPECT_EQ(session.poisson_ratio(), kPoissonRatio);
  EXPECT_GT(session.factor_bytes(), session_.factor_bytes());
  ASSERT_OK_AND_ASSIGN(const v1::DeformOnceResponse answer,
                       client_->DeformOnce(session.name(), TopPose(Turn(0.2))));
  EXPECT_GT(answer.summary().energies_nj_size(), 0);
  EXPECT_LT(Distance(answer.positions(), Solve(DeformationModel::kNeoHookean, Turn(0.2))),
            kFloat32Tolerance);
}

TEST_F(ModelsTest, PreparedAnswersAreTheDirectOnesWithinTheirBound) {
  for (const auto& [asked, model] :
       {std::pair(v1::DEFORMATION_MODEL_GRADIENT_FIELD, DeformationModel::kGradientField),
        std::pair(v1::DEFORMATION_MODEL_LINEAR_ELASTIC, DeformationModel::kLinearElastic)}) {
    const auto stream = Open(asked, Prepared(1e-3, 0.5));
    EXPECT_GT(stream->started().prepared_terms(), 0);
    EXPECT_LE(stream->started().prepared_terms(), stream->started().prepared_terms_before());
    EXPECT_GT(stream->started().prepared_bytes(), 0);
    for (int sequence = 1; sequence <= 3; ++sequence) {
      const HandlePose pose = Turn(0.15 * sequence);
      ASSERT_THAT(stream->SendPoses(sequence, TopPose(pose)), IsOk());
      const std::optional<v1::DeformFrame> frame = stream->Receive();
      ASSERT_TRUE(frame.has_value());
      EXPECT_TRUE(frame->summary().prepared());
      EXPECT_LE(frame->summary().error_bound_mm(), 1e-3);
      EXPECT_LE(Distance(frame->positions(), Solve(model, pose)),
                frame->summary().error_bound_mm() + kFloat32Tolerance);
      ASSERT_THAT(stream->Ack(*frame), IsOk());
    }
    stream->CloseSending();
    EXPECT_THAT(stream->Finish(), IsOk());
  }
}

// The estimate at once, the converged answer when the hand rests.
TEST_F(ModelsTest, NeoHookeanFollowsByEstimatesAndConvergesAtRest) {
  const auto stream = Open(v1::DEFORMATION_MODEL_NEO_HOOKEAN, Prepared(1e-3, 0.5));
  EXPECT_LT(stream->started().prepared_terms(), stream->started().prepared_terms_before());
  for (int sequence = 1; sequence <= 3; ++sequence) {
    const HandlePose pose = Turn(0.16 * sequence);
    ASSERT_THAT(stream->SendPoses(sequence, TopPose(pose)), IsOk());
    const Positions converged = Solve(DeformationModel::kNeoHookean, pose);
    std::optional<v1::DeformFrame> frame = stream->Receive();
    ASSERT_TRUE(frame.has_value());
    EXPECT_TRUE(frame->refining());
    EXPECT_TRUE(frame->summary().prepared());
    EXPECT_EQ(frame->summary().error_bound_mm(), 0);
    const double off = Distance(frame->positions(), converged);
    EXPECT_LE(off, 2 * frame->summary().error_estimate_mm());
    EXPECT_GT(off, 1e-4) << "this is no estimate";
    ASSERT_THAT(stream->Ack(*frame), IsOk());
    frame = stream->Receive();
    ASSERT_TRUE(frame.has_value());
    EXPECT_EQ(frame->sequence(), static_cast<uint64_t>(sequence));
    EXPECT_EQ(frame->refinement(), 1);
    EXPECT_FALSE(frame->refining());
    EXPECT_FALSE(frame->summary().prepared());
    EXPECT_LT(Distance(frame->positions(), converged), 1e-3);
    ASSERT_THAT(stream->Ack(*frame), IsOk());
  }
  // A drag that ends does not wait for the rest.
  ASSERT_THAT(stream->SendPoses(4, TopPose(Turn(0.1))), IsOk());
  stream->CloseSending();
  std::optional<v1::DeformFrame> frame = stream->Receive();
  ASSERT_TRUE(frame.has_value());
  EXPECT_TRUE(frame->refining());
  frame = stream->Receive();
  ASSERT_TRUE(frame.has_value());
  EXPECT_FALSE(frame->refining());
  EXPECT_FALSE(stream->Receive().has_value());
  EXPECT_THAT(stream->Finish(), IsOk());
}

TEST_F(ModelsTest, APoseBeyondTheRangeOfNeoHookeansEstimateIsSolved) {
  v1::PreparedAnswers prepared = Prepared(1e-3, 0.5);
  prepared.set_max_estimate_mm(1e-2);
  const auto stream = Open(v1::DEFORMATION_MODEL_NEO_HOOKEAN, prepared);
  ASSERT_THAT(stream->SendPoses(1, TopPose(Turn(0.4))), IsOk());
  std::optional<v1::DeformFrame> frame = stream->Receive();
  while (frame.has_value() && frame->refining()) {
    EXPECT_FALSE(frame->summary().prepared());
    ASSERT_THAT(stream->Ack(*frame), IsOk());
    frame = stream->Receive();
  }
  ASSERT_TRUE(frame.has_value());
  EXPECT_LT(Distance(frame->positions(), Solve(DeformationModel::kNeoHookean, Turn(0.4))), 1e-3);
}

TEST_F(ModelsTest, APoseBeyondThePreparedRangeIsAnsweredDirectly) {
  const auto stream = Open(v1::DEFORMATION_MODEL_UNSPECIFIED, Prepared(1e-3, 0.3));
  ASSERT_THAT(stream->SendPoses(1, TopPose(Turn(2 * M_PI))), IsOk());
  const std::optional<v1::DeformFrame> frame = stream->Receive();
  ASSERT_TRUE(frame.has_value());
  EXPECT_FALSE(frame->summary().prepared());
  EXPECT_LT(Distance(frame->positions(), Solve(DeformationModel::kGradientField, Turn(2 * M_PI))),
            kFloat32Tolerance);
}

TEST_F(ModelsTest, PreparedAnswersOfTheSkinHoldItsVerticesOnly) {
  DeformStream::Options options;
  options.vertices.kind = AnswerVertices::Kind::kSkin;
  options.prepared = Prepared(1e-3, 0.5);
  ASSERT_OK_AND_ASSIGN(const auto stream, client_->OpenStream(session_.name(), options));
  ASSERT_THAT(stream->SendPoses(1, TopPose(Turn(0.2))), IsOk());
  const std::optional<v1::DeformFrame> frame = stream->Receive();
  ASSERT_TRUE(frame.has_value());
  const Positions direct = Solve(DeformationModel::kGradientField, Turn(0.2));
  ASSERT_GT(stream->started().vertices_size(), 0);
  ASSERT_OK_AND_ASSIGN(const Positions skin,
                       DecodePositions(frame->positions(), stream->started().vertex_count()));
  for (int i = 0; i < stream->started().vertices_size(); ++i) {
    EXPECT_LT((skin.row(i) - direct.row(stream->started().vertices(i))).norm(),
              frame->summary().error_bound_mm() + kFloat32Tolerance);
  }
}

TEST_F(ModelsTest, RefusesInvalidPreparationsAndTheSessionGoesOn) {
  const auto refusal = [this](v1::DeformationModel model, const v1::PreparedAnswers& prepared) {
    DeformStream::Options options;
    options.model = model;
    options.prepared = prepared;
    return client_->OpenStream(session_.name(), options).status();
  };
  EXPECT_THAT(refusal(v1::DEFORMATION_MODEL_ARAP, Prepared(1e-3, 0.5)),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("prepared")));
  EXPECT_THAT(refusal(v1::DEFORMATION_MODEL_UNSPECIFIED, Prepared(-1, 0.5)),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("positive")));
  EXPECT_THAT(refusal(v1::DEFORMATION_MODEL_UNSPECIFIED,
                      Prepared(1, std::numeric_limits<double>::infinity())),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("positive")));
  EXPECT_THAT(refusal(static_cast<v1::DeformationModel>(77), Prepared(1e-3, 0.5)),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("77")));
  EXPECT_THAT(client_->DeformOnce(session_.name(), TopPose(Turn(0.1))), IsOk());
}

TEST_F(ModelsTest, PoissonsRatioOutOfRangeIsRefused) {
  for (const double nu : {-0.1, 0.5, std::numeric_limits<double>::quiet_NaN()}) {
    request_.poisson_ratio = nu;
    EXPECT_THAT(client_->CreateSession(request_).status(),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("Poisson")));
  }
  request_.poisson_ratio = 0.5 - 1e-13;
  request_.model = DeformationModel::kLinearElastic;
  EXPECT_THAT(client_->CreateSession(request_).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("condition")));
}

class SmallServerTest : public ServiceTest {};

TEST_F(SmallServerTest, AModelThatDoesNotFitIsRefusedAndTheSessionGoesOn) {
  // Room for the Laplacian of this bar and what makes it, not for a system three times as large.
  ServerOptions options = TestOptions();
  options.memory_budget_bytes = 2 << 20;
  StartServer(options);
  const BarProblem problem(1, {4, 4, 12});
  const auto client = Connect();
  const v1::Session session = MakeSession(client.get(), problem);
  const int64_t reserved = server().memory_budget().reserved_bytes();
  EXPECT_THAT(client->DeformOnce(session.name(), TopPose(Turn(0.1)), AnswerVertices{},
                                 v1::DEFORMATION_MODEL_LINEAR_ELASTIC),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("memory")));
  EXPECT_EQ(server().memory_budget().reserved_bytes(), reserved);
  EXPECT_THAT(client->DeformOnce(session.name(), TopPose(Turn(0.1))), IsOk());
}

}  // namespace
}  // namespace tissueform::testing
