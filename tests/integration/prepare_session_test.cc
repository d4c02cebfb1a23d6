// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/prepare_session.h"

#include <atomic>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/error_reason.h"
#include "tests/integration/service_test.h"
#include "tests/testing/status_matchers.h"

// PrepareSession over the network, by the client library.
namespace tissueform::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class PrepareSessionServiceTest : public ServiceTest {
 protected:
  v1::PrepareSessionRequest Creation(TissueformClient* client, const BarProblem& problem) {
    const absl::StatusOr<v1::Mesh> mesh = client->UploadMesh(problem.mesh, problem.CellArrays());
    EXPECT_THAT(mesh, IsOk());
    v1::PrepareSessionRequest request;
    *request.mutable_create() = ToProto(problem.Request(mesh.ok() ? mesh->name() : ""));
    return request;
  }

  PreparationWait Listening() {
    PreparationWait wait;
    wait.on_progress = [this](const v1::PreparationProgress& progress) {
      reported_.push_back(progress);
    };
    return wait;
  }

  const BarProblem problem_{5};
  std::vector<v1::PreparationProgress> reported_;
};

TEST_F(PrepareSessionServiceTest, GivesASessionThatAnswersAsACreatedOneDoes) {
  const auto client = Connect();
  v1::PrepareSessionRequest request = Creation(client.get(), problem_);
  DeformStream::Options stream;
  stream.vertices.kind = AnswerVertices::Kind::kSkin;
  stream.prepared.emplace();
  *request.mutable_stream() = DeformStream::ConfigurationOf(stream);
  ASSERT_OK_AND_ASSIGN(const v1::Session session, client->PrepareSession(request, Listening()));
  ASSERT_THAT(reported_, Not(IsEmpty()));
  // A slow network may deliver only the newest progress, but stages never go back.
  for (size_t i = 1; i < reported_.size(); ++i)
    EXPECT_GE(reported_[i].stage(), reported_[i - 1].stage());
  EXPECT_THAT(ProgressText(reported_.front()), Not(IsEmpty()));
  ASSERT_OK_AND_ASSIGN(const v1::DeformOnceResponse answer,
                       client->DeformOnce(session.name(), TopPose(SomePose(2))));
  const v1::Session created = MakeSession(client.get(), problem_);
  ASSERT_OK_AND_ASSIGN(const v1::DeformOnceResponse expected,
                       client->DeformOnce(created.name(), TopPose(SomePose(2))));
  EXPECT_TRUE(answer.positions() == expected.positions());
  ASSERT_OK_AND_ASSIGN(const auto drag, client->OpenStream(session.name(), stream));
  EXPECT_GT(drag->started().prepared_terms(), 0);
}

TEST_F(PrepareSessionServiceTest, UpdatesAndOpensAndHasTheErrorsOfTheUnaryCalls) {
  const auto client = Connect();
  const v1::Session session = MakeSession(client.get(), problem_);
  v1::PrepareSessionRequest request;
  request.mutable_update()->set_name(session.name());
  request.mutable_update()->set_etag(session.etag());
  request.mutable_update()->set_model(v1::DEFORMATION_MODEL_LINEAR_ELASTIC);
  ASSERT_OK_AND_ASSIGN(const v1::Session updated, client->PrepareSession(request, Listening()));
  EXPECT_EQ(updated.model(), v1::DEFORMATION_MODEL_LINEAR_ELASTIC);
  const absl::Status stale = client->PrepareSession(request, {}).status();
  EXPECT_TRUE(HasReason(stale, ErrorReason::kStaleEtag)) << stale;
  reported_.clear();
  request.set_open(session.name());
  ASSERT_OK_AND_ASSIGN(const v1::Session opened, client->PrepareSession(request, Listening()));
  EXPECT_EQ(opened.etag(), updated.etag());
  EXPECT_THAT(reported_, IsEmpty()) << "it is there";
  request.set_open("sessions/none");
  const absl::Status missing = client->PrepareSession(request, {}).status();
  EXPECT_TRUE(HasReason(missing, ErrorReason::kSessionNotFound)) << missing;
}

TEST_F(PrepareSessionServiceTest, ACancelledWaitEndsAndLeavesNothing) {
  const auto client = Connect();
  // Large enough to be cancelled before it is ready.
  const BarProblem large(6, {10, 10, 20});
  v1::PrepareSessionRequest request = Creation(client.get(), large);
  const int64_t mesh_bytes = server().memory_budget().reserved_bytes();
  request.mutable_create()->set_request_id("again");
  request.mutable_create()->set_model(v1::DEFORMATION_MODEL_LINEAR_ELASTIC);
  PreparationWait wait = Listening();
  wait.cancellation = Cancellation([this] { return !reported_.empty(); });
  EXPECT_THAT(client->PrepareSession(request, wait),
              StatusIs(absl::StatusCode::kCancelled, HasSubstr("")));
  EXPECT_TRUE(Eventually([&] {
    return server().sessions().table().size() == 0 &&
           server().memory_budget().reserved_bytes() == mesh_bytes;
  }));
  // The same request again: joins what is being given up, or starts it again.
  ASSERT_OK_AND_ASSIGN(const v1::Session session, client->PrepareSession(request, {}));
  EXPECT_THAT(client->DeleteSession(session.name()), IsOk());
}

TEST_F(PrepareSessionServiceTest, ConcurrentRequestsShareOnePreparation) {
  const auto first = Connect();
  const auto second = Connect();
  v1::PrepareSessionRequest request = Creation(first.get(), problem_);
  request.mutable_create()->set_request_id("shared");
  absl::StatusOr<v1::Session> one;
  std::thread other([&] { one = first->PrepareSession(request, {}); });
  const absl::StatusOr<v1::Session> two = second->PrepareSession(request, Listening());
  other.join();
  ASSERT_THAT(one, IsOk());
  ASSERT_THAT(two, IsOk());
  EXPECT_EQ(one->name(), two->name());
  EXPECT_EQ(server().sessions().table().size(), 1);
}

}  // namespace
}  // namespace tissueform::testing
