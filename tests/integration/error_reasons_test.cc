// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <string>
#include <thread>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/error_reason.h"
#include "tests/integration/service_test.h"
#include "tests/testing/status_matchers.h"

// What a client decides by arrives at the client: over the network, from where each error is made.
namespace tissueform::testing {
namespace {

class ErrorReasonsTest : public ServiceTest {
 protected:
  const BarProblem problem_{5};
};

TEST_F(ErrorReasonsTest, ServerLimits) {
  ServerOptions options = TestOptions();
  options.limits.max_sessions = 1;
  options.limits.max_streams = 1;
  options.limits.max_vertices = 300;
  StartServer(options);
  const auto client = Connect();
  const v1::Session session = MakeSession(client.get(), problem_);
  const absl::Status full = client->CreateSession(problem_.Request(session.mesh())).status();
  EXPECT_THAT(full, Because(ErrorReason::kTooManySessions));
  EXPECT_EQ(ErrorInfoOf(full).metadata.at("limit"), "1");
  ASSERT_OK_AND_ASSIGN(const auto stream, client->OpenStream(session.name(), {}));
  EXPECT_THAT(client->OpenStream(session.name(), {}), Because(ErrorReason::kTooManyStreams));
  const BarProblem large(1, {6, 6, 8});
  EXPECT_THAT(client->UploadMesh(large.mesh, {}), Because(ErrorReason::kMeshTooLarge));
}

TEST_F(ErrorReasonsTest, NoMemory) {
  ServerOptions options = TestOptions();
  options.memory_budget_bytes = 1000;
  StartServer(options);
  const absl::Status full = Connect()->UploadMesh(problem_.mesh, {}).status();
  EXPECT_THAT(full, Because(ErrorReason::kMemoryBudgetFull));
  EXPECT_EQ(ErrorInfoOf(full).metadata.at("limit_bytes"), "1000");
}

TEST_F(ErrorReasonsTest, AnUploadOfWhichNothingHasCome) {
  EXPECT_THAT(Connect()->QueryUpload("meshes/" + std::string(64, '0')),
              Because(ErrorReason::kUploadNotFound));
  EXPECT_THAT(Connect()->QueryUpload("face.vtu"), Because(ErrorReason::kInvalidRequest));
}

TEST_F(ErrorReasonsTest, ADragThatGoesWrong) {
  const auto client = Connect();
  const v1::Session session = MakeSession(client.get(), problem_);
  DeformStream::Options prepared;
  prepared.model = v1::DEFORMATION_MODEL_ARAP;
  prepared.prepared.emplace();
  EXPECT_THAT(client->OpenStream(session.name(), prepared),
              Because(ErrorReason::kNoPreparedAnswers));
  ASSERT_OK_AND_ASSIGN(const auto stream, client->OpenStream(session.name(), {}));
  ASSERT_THAT(stream->SendPoses(2, TopPose(SomePose(1))), IsOk());
  stream->SendPoses(2, TopPose(SomePose(2))).IgnoreError();
  stream->CloseSending();
  EXPECT_THAT(stream->Finish(), Because(ErrorReason::kPoseSequenceNotRising));
}

TEST_F(ErrorReasonsTest, ADrainingServer) {
  const auto client = Connect();
  const v1::Session session = MakeSession(client.get(), problem_);
  ASSERT_OK_AND_ASSIGN(const auto stream, client->OpenStream(session.name(), {}));
  std::thread drain([this] { server().Drain(); });
  absl::Status refusal;
  EXPECT_TRUE(Eventually([&] {
    refusal = client->CreateSession(problem_.Request(session.mesh())).status();
    return !refusal.ok();
  }));
  EXPECT_THAT(refusal, Because(ErrorReason::kServerDraining));
  stream->Cancel();
  drain.join();
}

}  // namespace
}  // namespace tissueform::testing
