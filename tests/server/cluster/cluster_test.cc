// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/server/cluster/cluster_test.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "grpcpp/create_channel.h"

#include "client/cpp/client_call.h"
#include "proto/conversion/geometry_conversion.h"
#include "proto/conversion/session_conversion.h"
#include "tests/server/store/postgres_store/test_database.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {

std::unique_ptr<grpc::ClientContext> As(const std::string& caller) {
  auto context = ContextOf({.name = caller, .link = ""});
  context->set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
  return context;
}

RawDrag::RawDrag(const TestNode& node, const std::string& session, const std::string& caller)
    : context_(As(caller)), stream_(node.stubs->deform->Deform(context_.get())) {
  v1::DeformRequest request;
  request.mutable_configuration()->set_session(session);
  stream_->Write(request);
}

RawDrag::~RawDrag() {
  context_->TryCancel();
  if (!finished_) Finish().IgnoreError();
}

bool RawDrag::Send(uint64_t sequence, bool commit) {
  v1::DeformRequest request;
  request.mutable_pose()->set_sequence(sequence);
  request.mutable_pose()->set_commit(commit);
  for (const NamedPose& pose : TopPose(SomePose(static_cast<int>(sequence)))) {
    *request.mutable_pose()->add_poses() = ToProto(pose);
  }
  return stream_->Write(request);
}

bool RawDrag::Read(v1::DeformResponse* response) {
  if (!stream_->Read(response)) return false;
  if (response->has_frame()) {
    v1::DeformRequest ack;
    ack.mutable_ack()->set_sequence(response->frame().sequence());
    stream_->Write(ack);
  }
  return true;
}

std::optional<v1::DeformFrame> RawDrag::ReceiveFrame(uint64_t sequence) {
  v1::DeformResponse response;
  while (Read(&response)) {
    if (response.has_frame() && response.frame().sequence() >= sequence) return response.frame();
  }
  return std::nullopt;
}

bool RawDrag::WaitForCommit(uint64_t sequence) {
  v1::DeformResponse response;
  while (Read(&response)) {
    if (response.notice().committed().sequence() >= sequence) return true;
  }
  return false;
}

std::string RawDrag::NextCommitsFailure() {
  v1::DeformResponse response;
  while (Read(&response)) {
    if (response.notice().has_committed()) return response.notice().committed().failure();
  }
  return "the stream has ended";
}

absl::Status RawDrag::Finish() {
  v1::DeformResponse response;
  while (stream_->Read(&response)) {
  }
  finished_ = true;
  return FromGrpcStatus(stream_->Finish());
}

void ClusterTest::SetUp() {
  TF_SKIP_WITHOUT_DATABASE();
  EmptyTestDatabase();
  a_ = StartNode(NodeOptions("a"));
  b_ = StartNode(NodeOptions("b"));
}

ServerOptions ClusterTest::NodeOptions(const std::string& name) {
  ServerOptions options;
  options.port = 0;
  options.workers = 2;
  options.memory_budget_bytes = int64_t{512} << 20;
  options.drain_deadline = std::chrono::seconds(8);
  options.in_memory = false;
  options.cluster = {.store = TestDatabaseOptions().url, .node_name = name};
  options.cluster.lease = {.duration = kTestLease,
                           .margin = std::chrono::milliseconds(400),
                           .patience = std::chrono::milliseconds(500)};
  options.cluster.renew_every = std::chrono::milliseconds(400);
  options.cluster.limits = {.unanswered_timeout = std::chrono::milliseconds(1'000),
                            .patience = std::chrono::milliseconds(5'000)};
  options.quotas.calls_per_second = 1'000'000;  // tests ask until it is so
  return options;
}

TestNode ClusterTest::StartNode(const ServerOptions& options) {
  TestNode node;
  auto server = TissueformServer::Start(options, &callers_);
  if (!server.ok()) {
    ADD_FAILURE() << server.status();
    return node;
  }
  node.server = *std::move(server);
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  arguments.SetMaxReceiveMessageSize(-1);
  node.stubs = std::make_unique<Stubs>(
      grpc::CreateCustomChannel(absl::StrCat("127.0.0.1:", node.server->port()),
                                grpc::InsecureChannelCredentials(), arguments));
  return node;
}

std::string ClusterTest::MakeSession(const TestNode& node, uint32_t seed, const std::string& id) {
  const SentMesh mesh(seed);
  v1::UploadMeshResponse sent;
  const Answer answer = SendMesh(*node.stubs, {.name = "ann", .link = ""}, mesh, &sent);
  EXPECT_TRUE(answer.status.ok()) << answer.status.error_message();
  SessionRequest request = mesh.problem.Request(mesh.name);
  request.session_id = id;
  v1::Session session;
  const absl::Status made =
      FromGrpcStatus(node.stubs->sessions->CreateSession(As().get(), ToProto(request), &session));
  EXPECT_THAT(made, IsOk());
  return session.name();
}

absl::StatusOr<v1::DeformOnceResponse> ClusterTest::AskOnce(const TestNode& node,
                                                            const std::string& session, int pose) {
  v1::DeformOnceRequest request;
  request.set_session(session);
  for (const NamedPose& named : TopPose(SomePose(pose))) *request.add_poses() = ToProto(named);
  v1::DeformOnceResponse response;
  const absl::Status status =
      FromGrpcStatus(node.stubs->deform->DeformOnce(As().get(), request, &response));
  if (!status.ok()) return status;
  return response;
}

int64_t ClusterTest::EpochOf(const std::string& session) {
  return RunSql(absl::StrCat("SELECT epoch FROM session_states JOIN sessions USING (key) WHERE id "
                             "= '",
                             absl::StripPrefix(session, "sessions/"), "'"))
      .Integer(0, 0);
}

}  // namespace tissueform::testing
