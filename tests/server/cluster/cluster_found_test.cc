// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "client/cpp/client_call.h"
#include "core/base/error_reason.h"
#include "proto/conversion/session_conversion.h"
#include "tests/server/cluster/cluster_test.h"
#include "tests/server/store/postgres_store/test_database.h"
#include "tests/testing/status_matchers.h"

// What one server has made or deleted, the others know.
namespace tissueform::testing {
namespace {

using ::testing::AnyOf;
using Code = absl::StatusCode;

class ClusterFoundTest : public ClusterTest {
 protected:
  std::string Predict(const TestNode& node, const std::string& session) {
    v1::CreatePredictionRequest request;
    request.set_session(session);
    request.add_poses()->set_handle("top");
    request.set_case_("cases/" + std::string(64, 'c'));
    v1::Prediction made;
    EXPECT_THAT(
        FromGrpcStatus(node.stubs->predictions->CreatePrediction(As().get(), request, &made)),
        IsOk());
    return made.name();
  }
  std::string Publish(const TestNode& node, const std::string& bytes) {
    v1::UploadCaseResponse sent;
    const Answer answer = SendCase(*node.stubs, {.name = "ANN", .link = ""}, bytes, "", &sent);
    EXPECT_TRUE(answer.status.ok()) << answer.status.error_message();
    return sent.case_().name();
  }
  // Each of these as it is found on the node, or why not.
  static absl::Status FindSession(const TestNode& node, const std::string& name,
                                  const std::string& caller = "ann") {
    v1::GetSessionRequest request;
    request.set_name(name);
    v1::Session found;
    return FromGrpcStatus(node.stubs->sessions->GetSession(As(caller).get(), request, &found));
  }
  static absl::Status FindMesh(const TestNode& node, const std::string& name) {
    v1::GetMeshRequest request;
    request.set_name(name);
    v1::Mesh found;
    return FromGrpcStatus(node.stubs->meshes->GetMesh(As().get(), request, &found));
  }
  static absl::Status FindPrediction(const TestNode& node, const std::string& name) {
    v1::GetPredictionRequest request;
    request.set_name(name);
    v1::Prediction found;
    return FromGrpcStatus(node.stubs->predictions->GetPrediction(As().get(), request, &found));
  }
  static absl::Status FindCase(const TestNode& node, const std::string& name) {
    v1::GetCaseRequest request;
    request.set_name(name);
    v1::Case found;
    return FromGrpcStatus(node.stubs->cases->GetCase(As("ANN").get(), request, &found));
  }
  static absl::StatusOr<v1::Export> FindExport(const TestNode& node, const std::string& name) {
    v1::GetExportRequest request;
    request.set_name(name);
    v1::Export found;
    const absl::Status status =
        FromGrpcStatus(node.stubs->exports->GetExport(As().get(), request, &found));
    if (!status.ok()) return status;
    return found;
  }
};

TEST_F(ClusterFoundTest, AnotherNodeFindsNewResourcesInTheNextCall) {
  for (int round = 0; round < 5; ++round) {
    const SentMesh mesh(100 + static_cast<uint32_t>(round));
    v1::UploadMeshResponse sent;
    ASSERT_TRUE(SendMesh(*a_.stubs, {.name = "ann", .link = ""}, mesh, &sent).status.ok());
    EXPECT_THAT(FindMesh(b_, mesh.name), IsOk());
    const std::string session = MakeSession(a_, 100 + static_cast<uint32_t>(round));
    EXPECT_THAT(FindSession(b_, session), IsOk());
    const std::string prediction = Predict(a_, session);
    EXPECT_THAT(FindPrediction(b_, prediction), IsOk());
    EXPECT_THAT(FindCase(b_, Publish(a_, absl::StrCat("glTF case ", round))), IsOk());
    v1::CreateExportRequest wanted;
    wanted.set_prediction(prediction);
    v1::Export made;
    ASSERT_THAT(FromGrpcStatus(a_.stubs->exports->CreateExport(As().get(), wanted, &made)), IsOk());
    EXPECT_THAT(FindExport(b_, made.name()), IsOk());
    v1::Export same;
    ASSERT_THAT(FromGrpcStatus(b_.stubs->exports->CreateExport(As().get(), wanted, &same)), IsOk());
    EXPECT_EQ(same.name(), made.name()) << "one that is not done is given again";
  }
}

TEST_F(ClusterFoundTest, AMissingSessionIsNotLookedUpAgainAtOnce) {
  const int64_t before = b_.server->cluster()->lookups().lookups();
  for (int i = 0; i < 50; ++i) {
    EXPECT_THAT(FindSession(b_, "sessions/nowhere"), StatusIs(Code::kNotFound));
  }
  EXPECT_LT(b_.server->cluster()->lookups().lookups() - before, 50);
}

TEST_F(ClusterFoundTest, AFollowLinkOpensItsSessionOnEveryNodeAtOnce) {
  const std::string session = MakeSession(a_, 1);
  v1::CreateFollowLinkRequest request;
  request.set_session(session);
  request.mutable_lifetime()->set_seconds(600);
  v1::FollowLink link;
  ASSERT_THAT(FromGrpcStatus(a_.stubs->access->CreateFollowLink(As().get(), request, &link)),
              IsOk());
  auto context = ContextOf({.name = "", .link = link.token()});
  v1::GetSessionRequest get;
  get.set_name(session);
  v1::Session found;
  EXPECT_THAT(FromGrpcStatus(b_.stubs->sessions->GetSession(context.get(), get, &found)), IsOk());
}

TEST_F(ClusterFoundTest, DeletionsAndSharesReachTheOtherNodesSoon) {
  const std::string session = MakeSession(a_, 1);
  const std::string prediction = Predict(a_, session);
  ASSERT_THAT(FindSession(b_, session), IsOk());
  ASSERT_THAT(FindPrediction(b_, prediction), IsOk());
  v1::CreateShareRequest share;
  share.mutable_share()->set_resource(session);
  share.mutable_share()->set_principal("bob");
  share.mutable_share()->set_role(v1::SHARE_ROLE_VIEWER);
  v1::Share shared;
  EXPECT_THAT(FindSession(b_, session, "bob"), StatusIs(Code::kNotFound));
  ASSERT_THAT(FromGrpcStatus(a_.stubs->access->CreateShare(As().get(), share, &shared)), IsOk());
  EXPECT_TRUE(Eventually([&] { return FindSession(b_, session, "bob").ok(); }));
  v1::DeletePredictionRequest remove;
  remove.set_name(prediction);
  google::protobuf::Empty nothing;
  ASSERT_THAT(FromGrpcStatus(a_.stubs->predictions->DeletePrediction(As().get(), remove, &nothing)),
              IsOk());
  EXPECT_TRUE(Eventually([&] { return absl::IsNotFound(FindPrediction(b_, prediction)); }));
  // And by hand.
  RunSql("DELETE FROM sessions;");
  EXPECT_TRUE(Eventually([&] { return absl::IsNotFound(FindSession(b_, session)); }));
  EXPECT_TRUE(Eventually([&] { return b_.server->sessions().table().CountKnown() == 0; }));
}

TEST_F(ClusterFoundTest, ANodeThatMissedNoticesCatchesUp) {
  const std::string session = MakeSession(a_, 1);
  ASSERT_TRUE(Eventually([&] { return b_.server->sessions().table().CountKnown() == 1; }));
  // In one transaction: when b's listener is back the session is long gone.
  RunSql(
      "DELETE FROM sessions; SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE "
      "application_name = 'tissueform-server' AND pid <> pg_backend_pid();");
  EXPECT_TRUE(Eventually([&] { return b_.server->sessions().table().CountKnown() == 0; }));
  EXPECT_THAT(FindSession(b_, session), StatusIs(Code::kNotFound));
}

TEST_F(ClusterFoundTest, TheSecondOfTwoChangesOfAnExportIsRefusedAsStale) {
  const std::string prediction = Predict(a_, MakeSession(a_, 1));
  v1::CreateExportRequest wanted;
  wanted.set_prediction(prediction);
  v1::Export made;
  ASSERT_THAT(FromGrpcStatus(a_.stubs->exports->CreateExport(As().get(), wanted, &made)), IsOk());
  v1::UpdateExportRequest change;
  change.set_name(made.name());
  change.set_state(v1::EXPORT_STATE_STORING);
  change.set_etag(made.etag());
  v1::Export changed;
  ASSERT_THAT(FindExport(b_, made.name()), IsOk());
  ASSERT_THAT(FromGrpcStatus(b_.stubs->exports->UpdateExport(As("BRIDGE").get(), change, &changed)),
              IsOk());
  const absl::Status second =
      FromGrpcStatus(a_.stubs->exports->UpdateExport(As("BRIDGE").get(), change, &changed));
  EXPECT_TRUE(HasReason(second, ErrorReason::kStaleEtag)) << second;
  ASSERT_OK_AND_ASSIGN(const v1::Export seen, FindExport(a_, made.name()));
  EXPECT_EQ(seen.state(), v1::EXPORT_STATE_STORING);
}

TEST_F(ClusterFoundTest, AMeshThatAnotherNodeHasMadeASessionOfIsNotDeleted) {
  const SentMesh mesh(1);
  const std::string session = MakeSession(b_, 1);
  ASSERT_THAT(FindMesh(a_, mesh.name), IsOk());
  v1::DeleteMeshRequest remove;
  remove.set_name(mesh.name);
  google::protobuf::Empty nothing;
  const absl::Status refusal =
      FromGrpcStatus(a_.stubs->meshes->DeleteMesh(As().get(), remove, &nothing));
  EXPECT_TRUE(HasReason(refusal, ErrorReason::kMeshInUse)) << refusal;
  EXPECT_THAT(AskOnce(b_, session, 1), IsOk());
}

TEST_F(ClusterFoundTest, FullNodeNamesANodeWithRoom) {
  ServerOptions small = NodeOptions("small");
  small.memory_budget_bytes = 1 << 20;
  small.quotas.memory_bytes = 1 << 30;
  const TestNode node = StartNode(small);
  // As large as others are not; the table is read every second.
  absl::Status refusal;
  ASSERT_TRUE(Eventually([&] {
    const SentMesh mesh(7);
    v1::UploadMeshResponse sent;
    SendMesh(*a_.stubs, {.name = "ann", .link = ""}, mesh, &sent);
    SessionRequest request = mesh.problem.Request(mesh.name);
    request.model = DeformationModel::kNeoHookean;
    v1::Session session;
    for (int i = 0; i < 50; ++i) {
      refusal = FromGrpcStatus(
          node.stubs->sessions->CreateSession(As().get(), ToProto(request), &session));
      if (!refusal.ok()) break;
    }
    return ErrorInfoOf(refusal).metadata.contains("node");
  })) << refusal;
  EXPECT_TRUE(HasReason(refusal, ErrorReason::kMemoryBudgetFull)) << refusal;
  EXPECT_THAT(ErrorInfoOf(refusal).metadata["node"], AnyOf("a", "b"));
}

}  // namespace
}  // namespace tissueform::testing
