// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <memory>
#include <optional>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/integration/service_test.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class DeformStreamTest : public ServiceTest {
 protected:
  void SetUp() override {
    client_ = Connect();
    session_ = MakeSession(client_.get(), problem_).name();
  }

  std::unique_ptr<DeformStream> Open(std::optional<int> max_unacked = {},
                                     AnswerVertices vertices = {}) {
    DeformStream::Options options;
    options.max_unacked = max_unacked;
    options.vertices = std::move(vertices);
    auto stream = client_->OpenStream(session_, options);
    EXPECT_THAT(stream, IsOk());
    return stream.ok() ? *std::move(stream) : nullptr;
  }

  bool NoStreamIsLeft() {
    return Eventually([this] { return server().streams().size() == 0; });
  }

  const BarProblem problem_{1};
  std::unique_ptr<TissueformClient> client_;
  std::string session_;
};

TEST_F(DeformStreamTest, EveryPoseInLockstepIsAnsweredRightly) {
  const auto stream = Open();
  EXPECT_EQ(stream->started().vertex_count(), problem_.mesh.num_vertices());
  EXPECT_EQ(stream->started().vertices_size(), 0);
  EXPECT_EQ(stream->started().max_unacked(), 2);
  for (int i = 1; i <= 5; ++i) {
    ASSERT_THAT(stream->SendPoses(i, TopPose(SomePose(i))), IsOk());
    const auto frame = stream->Receive();
    ASSERT_TRUE(frame.has_value());
    EXPECT_EQ(frame->sequence(), i);
    EXPECT_EQ(frame->coalesced_count(), 0);
    ASSERT_OK_AND_ASSIGN(const Positions positions,
                         DecodePositions(frame->positions(), problem_.mesh.num_vertices()));
    EXPECT_LT((positions - problem_.Solve(SomePose(i))).cwiseAbs().maxCoeff(), kFloat32Tolerance);
    ASSERT_THAT(stream->Ack(i), IsOk());
  }
  stream->CloseSending();
  EXPECT_FALSE(stream->Receive().has_value());
  EXPECT_THAT(stream->Finish(), IsOk());
  EXPECT_TRUE(NoStreamIsLeft());
}

TEST_F(DeformStreamTest, SkinAndListAnswerTheirVertices) {
  const Positions expected = problem_.Solve(SomePose(1));
  using Kind = AnswerVertices::Kind;
  const auto skin = Open({}, {.kind = Kind::kSkin, .list = {}});
  const auto list = Open({}, {.kind = Kind::kList, .list = {7, 2}});
  EXPECT_THAT(list->started().vertices(), ElementsAre(7, 2));
  EXPECT_GT(skin->started().vertex_count(), 2);
  EXPECT_LT(skin->started().vertex_count(), problem_.mesh.num_vertices());
  for (DeformStream* stream : {skin.get(), list.get()}) {
    ASSERT_EQ(stream->started().vertices_size(), stream->started().vertex_count());
    ASSERT_THAT(stream->SendPoses(1, TopPose(SomePose(1))), IsOk());
    const auto frame = stream->Receive();
    ASSERT_TRUE(frame.has_value());
    ASSERT_OK_AND_ASSIGN(const Positions positions,
                         DecodePositions(frame->positions(), stream->started().vertex_count()));
    for (int i = 0; i < stream->started().vertices_size(); ++i) {
      const int32_t vertex = stream->started().vertices(i);
      EXPECT_LT((positions.row(i) - expected.row(vertex)).norm(), kFloat32Tolerance);
    }
  }
}

TEST_F(DeformStreamTest, PackedFramesAreThePositionsWithinHalfOfTheirStep) {
  const auto packed = v1::POSITION_ENCODING_INT16_ZSTD;
  const Positions expected = problem_.Solve(SomePose(1));
  const Positions& rest = problem_.mesh.positions();
  for (const bool prepared : {false, true}) {
    DeformStream::Options options;
    options.vertices.kind = AnswerVertices::Kind::kSkin;
    options.encoding = packed;
    if (prepared) options.prepared.emplace();
    ASSERT_OK_AND_ASSIGN(const auto stream, client_->OpenStream(session_, options));
    ASSERT_THAT(stream->SendPoses(1, TopPose(SomePose(1))), IsOk());
    const auto frame = stream->Receive();
    ASSERT_TRUE(frame.has_value());
    EXPECT_EQ(frame->summary().prepared(), prepared);
    const std::vector<int32_t> skin(stream->started().vertices().begin(),
                                    stream->started().vertices().end());
    ASSERT_OK_AND_ASSIGN(
        const Positions positions,
        DecodePositions(frame->positions(), packed, frame->step_mm(), rest(skin, Eigen::all)));
    const Positions errors = positions - expected(skin, Eigen::all);
    const double from_preparing = prepared ? 0.01 : 0;
    EXPECT_LE(errors.cwiseAbs().maxCoeff(),
              frame->step_mm() * 0.505 + kFloat32Tolerance + from_preparing);
    EXPECT_GT(frame->step_mm(), 0);
  }
  ASSERT_OK_AND_ASSIGN(const auto once,
                       client_->DeformOnce(session_, TopPose(SomePose(1)), {}, {}, packed));
  ASSERT_OK_AND_ASSIGN(const Positions positions,
                       DecodePositions(once.positions(), packed, once.step_mm(), rest));
  EXPECT_LE((positions - expected).cwiseAbs().maxCoeff(), once.step_mm() * 0.505);
}

TEST_F(DeformStreamTest, TheNewestPoseWinsAndTheReplacedOnesAreCounted) {
  const auto stream = Open(1);
  ASSERT_THAT(stream->SendPoses(10, TopPose(SomePose(1))), IsOk());
  ASSERT_EQ(stream->Receive()->sequence(), 10);
  // The only credit is spent: these wait, each in place of the one before.
  for (const int sequence : {11, 12, 15, 17}) {
    ASSERT_THAT(stream->SendPoses(sequence, TopPose(SomePose(sequence))), IsOk());
  }
  ASSERT_THAT(stream->Ack(10), IsOk());
  const auto frame = stream->Receive();
  ASSERT_TRUE(frame.has_value());
  EXPECT_EQ(frame->sequence(), 17);
  EXPECT_EQ(frame->coalesced_count(), 3);
  ASSERT_OK_AND_ASSIGN(const Positions positions,
                       DecodePositions(frame->positions(), problem_.mesh.num_vertices()));
  EXPECT_LT((positions - problem_.Solve(SomePose(17))).cwiseAbs().maxCoeff(), kFloat32Tolerance);
}

TEST_F(DeformStreamTest, NoMoreFramesThanCredits) {
  const auto stream = Open(2);
  for (const int sequence : {1, 2}) {
    ASSERT_THAT(stream->SendPoses(sequence, TopPose(SomePose(sequence))), IsOk());
    ASSERT_EQ(stream->Receive()->sequence(), sequence);
  }
  // Without a credit neither 3 nor 4 may come; with one it must be 4, and 3 counts as replaced.
  ASSERT_THAT(stream->SendPoses(3, TopPose(SomePose(3))), IsOk());
  ASSERT_THAT(stream->SendPoses(4, TopPose(SomePose(4))), IsOk());
  ASSERT_THAT(stream->Ack(1), IsOk());
  const auto frame = stream->Receive();
  ASSERT_TRUE(frame.has_value());
  EXPECT_EQ(frame->sequence(), 4);
  EXPECT_EQ(frame->coalesced_count(), 1);
}

TEST_F(DeformStreamTest, AnsweredAndReplacedPosesAddUp) {
  constexpr int kPoses = 300;
  const auto stream = Open();
  for (int i = 1; i <= kPoses; ++i) {
    ASSERT_THAT(stream->SendPoses(i, TopPose(SomePose(i % 7))), IsOk());
  }
  int64_t accounted = 0;
  uint64_t last = 0;
  stream->CloseSending();
  while (const auto frame = stream->Receive()) {
    EXPECT_GT(frame->sequence(), last);
    last = frame->sequence();
    accounted += 1 + frame->coalesced_count();
  }
  EXPECT_THAT(stream->Finish(), IsOk());
  EXPECT_EQ(last, kPoses) << "the newest pose must be answered";
  EXPECT_EQ(accounted, kPoses);
}

TEST_F(DeformStreamTest, AfterTheClientClosesTheLastPoseNeedsNoCredit) {
  const auto stream = Open(1);
  ASSERT_THAT(stream->SendPoses(1, TopPose(SomePose(1))), IsOk());
  ASSERT_EQ(stream->Receive()->sequence(), 1);
  ASSERT_THAT(stream->SendPoses(2, TopPose(SomePose(2))), IsOk());
  stream->CloseSending();
  EXPECT_EQ(stream->Receive()->sequence(), 2);
  EXPECT_FALSE(stream->Receive().has_value());
  EXPECT_THAT(stream->Finish(), IsOk());
}

TEST_F(DeformStreamTest, SendingAfterTheEndFails) {
  const auto stream = Open();
  stream->CloseSending();
  EXPECT_THAT(stream->SendPoses(1, TopPose(SomePose(1))),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("ended")));
  EXPECT_THAT(stream->Finish(), IsOk());
}

TEST_F(DeformStreamTest, ADeletedSessionEndsItsStreams) {
  const auto stream = Open();
  ASSERT_THAT(client_->DeleteSession(session_), IsOk());
  ASSERT_THAT(stream->SendPoses(1, TopPose(SomePose(1))), IsOk());
  EXPECT_FALSE(stream->Receive().has_value());
  EXPECT_THAT(stream->Finish(), StatusIs(absl::StatusCode::kNotFound, HasSubstr("deleted")));
  ExpectServes();
}

TEST_F(DeformStreamTest, CancelledStreamIsCleanedUpWithoutAffectingOthers) {
  for (int i = 0; i < 10; ++i) {
    const auto stream = Open();
    for (int sequence = 1; sequence <= i; ++sequence) {
      ASSERT_THAT(stream->SendPoses(sequence, TopPose(SomePose(sequence))), IsOk());
    }
    stream->Cancel();
    EXPECT_EQ(stream->Finish().code(), absl::StatusCode::kCancelled);
  }
  EXPECT_TRUE(NoStreamIsLeft());
  EXPECT_THAT(client_->GetSession(session_), IsOk());
  ExpectServes();
}

TEST_F(DeformStreamTest, LostConnectionIsCleanedUpWithoutAffectingOthers) {
  for (int i = 0; i < 5; ++i) {
    const auto stub = v1::DeformService::NewStub(OwnChannel());
    grpc::ClientContext context;
    const auto call = stub->Deform(&context);
    v1::DeformRequest request;
    request.mutable_configuration()->set_session(session_);
    ASSERT_TRUE(call->Write(request));
    request.mutable_pose()->set_sequence(1);
    *request.mutable_pose()->add_poses() = ToProto(TopPose(SomePose(1))[0]);
    ASSERT_TRUE(call->Write(request));
    // Call and channel go without a word of goodbye.
  }
  EXPECT_TRUE(NoStreamIsLeft());
  ExpectServes();
}

TEST_F(DeformStreamTest, UnacknowledgedPoseFloodGetsTwoFramesAndTheNewestPose) {
  constexpr int kFlood = 20'000;
  const int64_t bytes = server().memory_budget().reserved_bytes();
  const auto flood = Open();
  for (int sequence = 1; sequence <= kFlood; ++sequence) {
    ASSERT_THAT(flood->SendPoses(sequence, TopPose(SomePose(sequence % 5))), IsOk());
    if (sequence % 5'000 == 0) {
      EXPECT_THAT(client_->DeformOnce(session_, TopPose(SomePose(1))), IsOk()) << "others go on";
    }
  }
  // The credits are spent: what comes next is the newest pose, once no more will come.
  std::vector<v1::DeformFrame> frames;
  flood->CloseSending();
  while (std::optional<v1::DeformFrame> frame = flood->Receive()) frames.push_back(*frame);
  EXPECT_THAT(flood->Finish(), IsOk());
  ASSERT_EQ(frames.size(), 3U);
  EXPECT_EQ(frames[2].sequence(), static_cast<uint64_t>(kFlood));
  int64_t accounted = 0;
  for (const v1::DeformFrame& frame : frames) accounted += 1 + frame.coalesced_count();
  EXPECT_EQ(accounted, kFlood);
  EXPECT_EQ(server().memory_budget().reserved_bytes(), bytes);
  ExpectServes();
}

TEST_F(DeformStreamTest, StalledReaderBlocksNoOtherStream) {
  const BarProblem big(2, {8, 8, 24});
  const std::string big_session = MakeSession(client_.get(), big).name();
  const auto stub = v1::DeformService::NewStub(OwnChannel());
  grpc::ClientContext context;
  const auto call = stub->Deform(&context);
  v1::DeformRequest request;
  request.mutable_configuration()->set_session(big_session);
  request.mutable_configuration()->set_max_unacked(64);
  ASSERT_TRUE(call->Write(request));
  for (int sequence = 1; sequence <= 200; ++sequence) {
    request.mutable_pose()->set_sequence(sequence);
    request.mutable_pose()->clear_poses();
    *request.mutable_pose()->add_poses() = ToProto(TopPose(SomePose(sequence % 5))[0]);
    ASSERT_TRUE(call->Write(request));
  }
  const auto stream = Open();
  for (int i = 1; i <= 20; ++i) {
    ASSERT_THAT(stream->SendPoses(i, TopPose(SomePose(i))), IsOk());
    ASSERT_TRUE(stream->Receive().has_value());
    ASSERT_THAT(stream->Ack(i), IsOk());
  }
  ExpectServes();
  // Its own session still works for others.
  EXPECT_THAT(client_->DeformOnce(big_session, TopPose(SomePose(1))), IsOk());
  context.TryCancel();
  v1::DeformResponse dropped;
  while (call->Read(&dropped)) {
  }
  EXPECT_EQ(call->Finish().error_code(), grpc::StatusCode::CANCELLED);
  stream->CloseSending();
  EXPECT_THAT(stream->Finish(), IsOk());
  EXPECT_TRUE(NoStreamIsLeft());
}

TEST_F(DeformStreamTest, TooManyStreamsAreRefused) {
  ServerOptions options = TestOptions();
  options.limits.max_streams = 1;
  StartServer(options);
  SetUp();
  const auto first = Open();
  EXPECT_THAT(client_->OpenStream(session_, {}),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("--max-streams")));
  first->CloseSending();
  EXPECT_THAT(first->Finish(), IsOk());
  EXPECT_TRUE(NoStreamIsLeft());
  EXPECT_NE(Open(), nullptr);
}

}  // namespace
}  // namespace tissueform::testing
