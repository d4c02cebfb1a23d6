// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// Streams of a session whose model iterates: early answers, warm starts, answers given up for a
// newer pose.

#include <memory>
#include <optional>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mechanics/deformation/create_deformer.h"
#include "tests/integration/service_test.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;

constexpr double kToleranceMm = 1e-7;

HandlePose Shift(double y_mm) {
  HandlePose pose;
  pose.translation_mm = {0, y_mm, 0};
  return pose;
}

class EstimatedStreamTest : public ServiceTest {
 protected:
  void SetUp() override {
    client_ = Connect();
    auto mesh = client_->UploadMesh(problem_.mesh, problem_.CellArrays());
    ASSERT_THAT(mesh, IsOk());
    SessionRequest request = problem_.Request(mesh->name());
    request.gradient_field.rotation = RotationMode::kEstimated;
    request.gradient_field.max_iterations = 200;
    request.gradient_field.tolerance_mm = kToleranceMm;
    auto session = client_->CreateSession(request);
    ASSERT_THAT(session, IsOk());
    session_ = *session;
  }

  std::unique_ptr<DeformStream> Open(int max_unacked) {
    DeformStream::Options options;
    options.max_unacked = max_unacked;
    auto stream = client_->OpenStream(session_.name(), options);
    EXPECT_THAT(stream, IsOk());
    return stream.ok() ? *std::move(stream) : nullptr;
  }

  Positions Solve(const HandlePose& pose) const {
    DeformerOptions options;
    options.gradient_field.rotation = RotationMode::kEstimated;
    options.gradient_field.max_iterations = 200;
    options.gradient_field.tolerance_mm = kToleranceMm;
    auto deformer =
        CreateDeformer(problem_.mesh, problem_.stiffness, problem_.constraints, options);
    return (*deformer)->Deform({pose})->positions;
  }

  const BarProblem problem_{1, {4, 4, 12}};
  std::unique_ptr<TissueformClient> client_;
  v1::Session session_;
};

TEST_F(EstimatedStreamTest, TheSessionReturnsItsSettings) {
  EXPECT_EQ(session_.gradient_field().rotation_mode(), v1::ROTATION_MODE_ESTIMATED);
  EXPECT_EQ(session_.gradient_field().max_iterations(), 200);
  EXPECT_EQ(session_.gradient_field().tolerance_mm(), kToleranceMm);
  EXPECT_EQ(session_.gradient_field().blend(), v1::BLEND_MAP_COSINE);
}

TEST_F(EstimatedStreamTest, OnceAnswersWithItsHistory) {
  ASSERT_OK_AND_ASSIGN(const v1::DeformOnceResponse answer,
                       client_->DeformOnce(session_.name(), TopPose(Shift(2))));
  EXPECT_TRUE(answer.summary().converged());
  EXPECT_EQ(answer.summary().changes_mm_size(), answer.summary().iterations() - 1);
  ASSERT_OK_AND_ASSIGN(const Positions positions,
                       DecodePositions(answer.positions(), problem_.mesh.num_vertices()));
  EXPECT_LT((positions - Solve(Shift(2))).cwiseAbs().maxCoeff(), kFloat32Tolerance);
}

TEST_F(EstimatedStreamTest, EarlyAnswersComeBeforeTheConvergedOne) {
  const auto stream = Open(4);
  // An early answer gives way to a later one while a message before it is still on its way, so a
  // slow machine may see none for one pose; hardly for ten.
  bool came_early = false;
  for (int pose = 1; pose <= 10 && !came_early; ++pose) {
    const HandlePose shift = Shift(2 + 0.1 * pose);
    ASSERT_THAT(stream->SendPoses(pose, TopPose(shift)), IsOk());
    std::optional<v1::DeformFrame> frame = stream->Receive();
    ASSERT_TRUE(frame.has_value());
    int32_t expected_refinement = 0;
    while (frame->refining()) {
      came_early = true;
      EXPECT_EQ(frame->sequence(), static_cast<uint64_t>(pose));
      EXPECT_EQ(frame->refinement(), expected_refinement++);
      EXPECT_FALSE(frame->summary().converged());
      ASSERT_THAT(stream->Ack(*frame), IsOk());
      frame = stream->Receive();
      ASSERT_TRUE(frame.has_value());
    }
    EXPECT_TRUE(frame->summary().converged());
    ASSERT_OK_AND_ASSIGN(const Positions positions,
                         DecodePositions(frame->positions(), problem_.mesh.num_vertices()));
    EXPECT_LT((positions - Solve(shift)).cwiseAbs().maxCoeff(), kFloat32Tolerance);
    ASSERT_THAT(stream->Ack(*frame), IsOk());
  }
  EXPECT_TRUE(came_early) << "the first iteration cannot have converged";
}

TEST_F(EstimatedStreamTest, WithOneCreditThereIsOneFrameAPose) {
  const auto stream = Open(1);
  for (int sequence = 1; sequence <= 3; ++sequence) {
    ASSERT_THAT(stream->SendPoses(sequence, TopPose(Shift(0.5 * sequence))), IsOk());
    const std::optional<v1::DeformFrame> frame = stream->Receive();
    ASSERT_TRUE(frame.has_value());
    EXPECT_EQ(frame->sequence(), static_cast<uint64_t>(sequence));
    EXPECT_FALSE(frame->refining());
    EXPECT_TRUE(frame->summary().converged());
    ASSERT_THAT(stream->Ack(*frame), IsOk());
  }
}

TEST_F(EstimatedStreamTest, SmallStepsOfADragNeedFewIterations) {
  const auto stream = Open(1);
  int first_iterations = 0;
  for (int sequence = 1; sequence <= 4; ++sequence) {
    ASSERT_THAT(stream->SendPoses(sequence, TopPose(Shift(2 + 1e-5 * sequence))), IsOk());
    const std::optional<v1::DeformFrame> frame = stream->Receive();
    ASSERT_TRUE(frame.has_value());
    if (sequence == 1) {
      first_iterations = frame->summary().iterations();
    } else {
      EXPECT_LT(frame->summary().iterations(), first_iterations);
    }
    ASSERT_THAT(stream->Ack(*frame), IsOk());
  }
}

TEST_F(EstimatedStreamTest, ABurstOfPosesEndsAtTheNewestOneConverged) {
  constexpr int kPoses = 100;
  const auto stream = Open(3);
  for (int sequence = 1; sequence <= kPoses; ++sequence) {
    ASSERT_THAT(stream->SendPoses(sequence, TopPose(Shift(0.02 * sequence))), IsOk());
  }
  int64_t accounted = 0;
  uint64_t last = 0;
  std::optional<v1::DeformFrame> frame;
  do {
    frame = stream->Receive();
    ASSERT_TRUE(frame.has_value());
    ASSERT_THAT(stream->Ack(*frame), IsOk());
    EXPECT_GE(frame->sequence(), last);
    accounted += (frame->sequence() > last ? 1 : 0) + frame->coalesced_count();
    last = frame->sequence();
  } while (last < kPoses || frame->refining());
  EXPECT_TRUE(frame->summary().converged());
  EXPECT_EQ(accounted, kPoses);
  ASSERT_OK_AND_ASSIGN(const Positions positions,
                       DecodePositions(frame->positions(), problem_.mesh.num_vertices()));
  EXPECT_LT((positions - Solve(Shift(0.02 * kPoses))).cwiseAbs().maxCoeff(), kFloat32Tolerance);
}

TEST_F(EstimatedStreamTest, SettingsOutOfRangeAreRefused) {
  auto mesh = client_->UploadMesh(problem_.mesh, problem_.CellArrays());
  ASSERT_THAT(mesh, IsOk());
  SessionRequest request = problem_.Request(mesh->name());
  request.gradient_field.max_iterations = 1'000'000;
  EXPECT_THAT(client_->CreateSession(request),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("max_iterations")));
  request.gradient_field.max_iterations = 10;
  request.gradient_field.tolerance_mm = -1;
  EXPECT_THAT(client_->CreateSession(request),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("tolerance_mm")));
  request.gradient_field.tolerance_mm = 1;
  v1::CreateSessionRequest unknown = ToProto(request);
  unknown.mutable_gradient_field()->set_guidance(static_cast<v1::Guidance>(9));
  const auto stub = v1::SessionService::NewStub(OwnChannel());
  grpc::ClientContext context;
  v1::Session session;
  const grpc::Status refusal = stub->CreateSession(&context, unknown, &session);
  EXPECT_EQ(refusal.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_THAT(refusal.error_message(), HasSubstr("guidance"));
}

}  // namespace
}  // namespace tissueform::testing
