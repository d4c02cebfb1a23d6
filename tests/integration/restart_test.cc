// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// What the real program has acknowledged is there when it is killed and started again, and a drag
// goes on.

#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "grpcpp/create_channel.h"
#include "gtest/gtest.h"

#include "client/cli/session/server_process.h"
#include "client/cpp/reattaching_stream.h"
#include "client/cpp/tissueform_client.h"
#include "core/base/error_reason.h"
#include "proto/conversion/answer_conversion.h"
#include "proto/conversion/mesh_conversion.h"
#include "tests/integration/durable_server.h"
#include "tests/integration/service_test.h"
#include "tests/testing/file_bytes.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;

class RestartTest : public ::testing::Test {
 protected:
  void Start() { ASSERT_THAT(server_.Start(), IsOk()); }
  void Kill() { ASSERT_THAT(server_.Kill(), IsOk()); }

  std::unique_ptr<TissueformClient> Connect() const {
    absl::StatusOr<std::unique_ptr<TissueformClient>> client = server_.Connect();
    EXPECT_THAT(client, IsOk());
    return client.ok() ? *std::move(client) : nullptr;
  }

  v1::Session MakeSession(TissueformClient* client, const std::string& id) const {
    const absl::StatusOr<v1::Mesh> mesh = client->UploadMesh(bar_.mesh, bar_.CellArrays());
    EXPECT_THAT(mesh, IsOk());
    SessionRequest request = bar_.Request(mesh->name());
    request.session_id = id;
    const absl::StatusOr<v1::Session> session = client->CreateSession(request);
    EXPECT_THAT(session, IsOk());
    return *session;
  }

  const BarProblem bar_{1};
  DurableServer server_{"restart", {"--log-level", "warn"}};
};

TEST_F(RestartTest, ADragGoesOnThroughKillAndRestart) {
  ASSERT_NO_FATAL_FAILURE(Start());
  const std::unique_ptr<TissueformClient> client = Connect();
  const v1::Session session = MakeSession(client.get(), "a-session-of-this-test");
  ReattachingStream::Options options;
  std::vector<std::string> events;
  options.reattachment.on_detached = [&events](const absl::Status& /*why*/) {
    events.emplace_back("detached");
  };
  options.reattachment.on_reattached = [&events] { events.emplace_back("reattached"); };
  ASSERT_OK_AND_ASSIGN(const std::unique_ptr<ReattachingStream> drag,
                       ReattachingStream::Open(client.get(), session.name(), options));
  drag->SendPoses(1, TopPose(SomePose(1)), /*commit=*/true);
  std::optional<v1::DeformFrame> frame = drag->Receive();
  ASSERT_TRUE(frame.has_value());
  drag->Ack(*frame);
  const std::string before = frame->positions();
  drag->SendPoses(2, TopPose(SomePose(2)));
  frame = drag->Receive();  // the commit has been acknowledged by then or is sent again
  ASSERT_TRUE(frame.has_value());
  drag->Ack(*frame);

  ASSERT_NO_FATAL_FAILURE(Kill());
  std::thread restart([this] { Start(); });
  drag->SendPoses(3, TopPose(SomePose(1)));  // no server is there
  frame = drag->Receive();
  restart.join();
  ASSERT_TRUE(frame.has_value()) << drag->Finish();
  drag->Ack(*frame);
  // The drag starts again with what was not known to be committed, then comes the newest pose.
  while (frame.has_value() && frame->sequence() != 3) {
    frame = drag->Receive();
    if (frame.has_value()) drag->Ack(*frame);
  }
  ASSERT_TRUE(frame.has_value());
  EXPECT_EQ(frame->positions(), before) << "the same pose, to the last bit";
  EXPECT_EQ(drag->reattachments(), 1);
  EXPECT_EQ(events, (std::vector<std::string>{"detached", "reattached"}));
  drag->CloseSending();
  while (drag->Receive().has_value()) {
  }
  EXPECT_THAT(drag->Finish(), IsOk());

  ASSERT_OK_AND_ASSIGN(const v1::Session after, client->GetSession(session.name()));
  EXPECT_EQ(after.state(), v1::SESSION_STATE_READY);
  EXPECT_EQ(after.etag(), session.etag());
  ASSERT_EQ(after.committed_poses_size(), 1);
  EXPECT_EQ(after.committed_poses(0).translation_mm().x(), SomePose(1).translation_mm.x());
  // The mesh is needed as long as the session may come back.
  EXPECT_THAT(client->DeleteMesh(session.mesh()),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("1 session")));
}

// Killed in the middle, with what QueryUpload has said before on the disk.
TEST_F(RestartTest, AnUploadGoesOnThroughKillAndRestart) {
  ASSERT_NO_FATAL_FAILURE(Start());
  const BarProblem large(2, {16, 16, 40});
  const std::vector<CellArray> arrays = large.CellArrays();
  const MeshPayloadView payload =
      ViewMeshPayload(large.mesh.positions(), large.mesh.tets(), arrays);
  const std::string name = MeshName(payload.Sha256());
  int64_t committed = 0;
  std::vector<int64_t> resumed;
  UploadOptions options;
  options.on_progress = [&](int64_t sent, int64_t total) {
    if (committed > 0 || sent < total / 2) return;
    const std::unique_ptr<TissueformClient> other = Connect();
    ASSERT_TRUE(Eventually([&] {
      const absl::StatusOr<v1::QueryUploadResponse> query = other->QueryUpload(name);
      committed = query.ok() ? query->committed_bytes() : 0;
      return committed > 0;
    }));
    ASSERT_NO_FATAL_FAILURE(Kill());
    ASSERT_NO_FATAL_FAILURE(Start());
    ASSERT_OK_AND_ASSIGN(const v1::QueryUploadResponse query, Connect()->QueryUpload(name));
    EXPECT_GE(query.committed_bytes(), committed);
    EXPECT_LT(query.committed_bytes(), total);
    committed = query.committed_bytes();
  };
  options.on_resumed = [&](int64_t from, int64_t /*total*/) { resumed.push_back(from); };
  const std::unique_ptr<TissueformClient> client = Connect();
  ASSERT_OK_AND_ASSIGN(const v1::Mesh mesh, client->UploadMesh(large.mesh, arrays, options));
  EXPECT_EQ(mesh.name(), name);
  EXPECT_THAT(resumed, ::testing::ElementsAre(committed));
  // The server has checked the digest; these are the bytes that it keeps, behind their shape.
  std::string sent;
  for (const absl::string_view segment : payload.segments) absl::StrAppend(&sent, segment);
  int found = 0;
  for (const auto& entry : std::filesystem::directory_iterator(server_.folder() / "blobs")) {
    const std::string kept = BytesOfFile(entry.path());
    found += kept.size() > sent.size() && kept.substr(kept.size() - sent.size()) == sent ? 1 : 0;
  }
  EXPECT_EQ(found, 1);
  EXPECT_TRUE(std::filesystem::is_empty(server_.folder() / "uploads"))
      << "nothing is left of the way";
}

TEST_F(RestartTest, APartialUploadSurvivesARestart) {
  ASSERT_NO_FATAL_FAILURE(Start());
  const MeshPayloadView payload = ViewMeshPayload(bar_.mesh.positions(), bar_.mesh.tets(), {});
  {
    const auto stub = v1::MeshService::NewStub(
        grpc::CreateChannel(server_.address(), grpc::InsecureChannelCredentials()));
    grpc::ClientContext context;
    v1::UploadMeshResponse response;
    const auto writer = stub->UploadMesh(&context, &response);
    v1::UploadMeshRequest request;
    *request.mutable_header() = ToProto(payload.shape, payload.Sha256());
    writer->Write(request);
    request.mutable_chunk()->set_data(std::string(payload.segments[0].substr(0, 1000)));
    writer->Write(request);
    writer->WritesDone();
    EXPECT_EQ(writer->Finish().error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  }
  ASSERT_NO_FATAL_FAILURE(Kill());
  ASSERT_NO_FATAL_FAILURE(Start());
  const std::unique_ptr<TissueformClient> client = Connect();
  ASSERT_OK_AND_ASSIGN(const v1::QueryUploadResponse query,
                       client->QueryUpload(MeshName(payload.Sha256())));
  EXPECT_EQ(query.committed_bytes(), 1000);
  UploadOptions options;
  int64_t resumed = 0;
  options.on_resumed = [&resumed](int64_t from, int64_t /*total*/) { resumed = from; };
  EXPECT_THAT(client->UploadMesh(bar_.mesh, {}, options), IsOk());
  EXPECT_EQ(resumed, 1000);
}

TEST_F(RestartTest, AFailedCommitIsReportedWithoutTheServersPaths) {
  ASSERT_NO_FATAL_FAILURE(Start());
  const std::unique_ptr<TissueformClient> client = Connect();
  const v1::Session session = MakeSession(client.get(), "a-session-of-this-test");
  std::string failure;
  DeformStream::Options options;
  options.on_notice = [&failure](const v1::DeformNotice& notice) {
    failure = notice.committed().failure();
  };
  ASSERT_OK_AND_ASSIGN(const auto stream, client->OpenStream(session.name(), options));
  std::filesystem::remove_all(server_.folder());
  ASSERT_THAT(stream->SendPoses(1, TopPose(SomePose(1)), /*commit=*/true), IsOk());
  stream->CloseSending();
  while (stream->Receive().has_value()) continue;
  EXPECT_THAT(stream->Finish(), IsOk());
  EXPECT_THAT(failure, HasSubstr("removed"));
  EXPECT_THAT(failure, ::testing::Not(HasSubstr(server_.folder().filename().string())));
}

TEST_F(RestartTest, WithoutItsFolderTheServerKeepsNothingSaysSoAndAnswersOn) {
  ASSERT_NO_FATAL_FAILURE(Start());
  const std::unique_ptr<TissueformClient> client = Connect();
  const v1::Session session = MakeSession(client.get(), "a-session-of-this-test");
  std::filesystem::remove_all(server_.folder());
  const BarProblem other(2);
  SessionRequest request = bar_.Request(session.mesh());
  request.session_id = "another-session-of-this-test";
  UploadOptions impatient;
  impatient.give_up_after = std::chrono::milliseconds(100);
  for (const absl::Status& refused :
       {client->UploadMesh(other.mesh, {}, impatient).status(),
        client->CreateSession(request).status(),
        client->predictions().Create(session.name(), TopPose(SomePose(1))).status()}) {
    EXPECT_THAT(refused, StatusIs(absl::StatusCode::kUnavailable));
    EXPECT_EQ(ReasonOf(refused), ReasonName(ErrorReason::kUnavailable));
    EXPECT_THAT(refused.message(), ::testing::Not(HasSubstr(server_.folder().filename().string())));
  }
  ASSERT_OK_AND_ASSIGN(const v1::DeformOnceResponse answer,
                       client->DeformOnce(session.name(), TopPose(SomePose(3))));
  ASSERT_OK_AND_ASSIGN(const Positions positions,
                       DecodePositions(answer.positions(), bar_.mesh.num_vertices()));
  EXPECT_LT((positions - bar_.Solve(SomePose(3))).cwiseAbs().maxCoeff(), kFloat32Tolerance);
  EXPECT_THAT(server_.Drain(), IsOk());
}

}  // namespace
}  // namespace tissueform::testing
