// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <memory>
#include <string>
#include <utility>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "proto/conversion/session_conversion.h"
#include "tests/integration/access_calls.h"
#include "tests/integration/service_test.h"

// AccessService, and what it does to streams.
namespace tissueform::testing {
namespace {

using Caller = AccessWorld::Caller;
using Code = grpc::StatusCode;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

using DragStream = grpc::ClientReaderWriter<v1::DeformRequest, v1::DeformResponse>;
using WatchReader = grpc::ClientReader<v1::WatchResponse>;

class AccessServiceTest : public ServiceTest {
 protected:
  void SetUp() override {
    StartServer(TestOptions(), &callers_);
    stubs_ = std::make_unique<Stubs>(OwnChannel());
    v1::UploadMeshResponse uploaded;
    ASSERT_TRUE(SendMesh(*stubs_, ann_, mesh_, &uploaded).status.ok());
    v1::Session session;
    ASSERT_TRUE(stubs_->sessions
                    ->CreateSession(ContextOf(ann_).get(),
                                    ToProto(mesh_.problem.Request(mesh_.name)), &session)
                    .ok());
    session_ = session.name();
  }
  void TearDown() override { StopServer(); }

  grpc::Status Share(const std::string& with, v1::ShareRole role) {
    v1::CreateShareRequest request;
    request.mutable_share()->set_resource(session_);
    request.mutable_share()->set_principal(with);
    request.mutable_share()->set_role(role);
    v1::Share share;
    return stubs_->access->CreateShare(ContextOf(ann_).get(), request, &share);
  }
  grpc::Status Unshare(const std::string& with) {
    v1::DeleteShareRequest request;
    request.set_resource(session_);
    request.set_principal(with);
    google::protobuf::Empty response;
    return stubs_->access->DeleteShare(ContextOf(ann_).get(), request, &response);
  }
  grpc::Status MakeLink(v1::CreateFollowLinkRequest request, v1::FollowLink* link) {
    request.set_session(session_);
    return stubs_->access->CreateFollowLink(ContextOf(ann_).get(), request, link);
  }
  // Has begun.
  std::unique_ptr<WatchReader> BeginWatch(grpc::ClientContext* context, std::string* name) {
    v1::WatchRequest request;
    request.set_session(session_);
    std::unique_ptr<WatchReader> watch = stubs_->deform->Watch(context, request);
    v1::WatchResponse message;
    EXPECT_TRUE(watch->Read(&message));
    *name = message.started().watch();
    return watch;
  }
  static grpc::Status EndOf(WatchReader* watch) {
    v1::WatchResponse message;
    while (watch->Read(&message)) {
    }
    return watch->Finish();
  }
  grpc::Status Acknowledge(const Caller& caller, const std::string& watch) {
    v1::AcknowledgeWatchRequest request;
    request.set_watch(watch);
    google::protobuf::Empty response;
    return stubs_->deform->AcknowledgeWatch(ContextOf(caller).get(), request, &response);
  }

  const Caller ann_{.name = "ANN", .link = ""};
  const Caller bob_{.name = "bob", .link = ""};
  NamedCallers callers_;
  const SentMesh mesh_{1};
  std::unique_ptr<Stubs> stubs_;
  std::string session_;
};

TEST_F(AccessServiceTest, ADragEndsWhenTheShareThatItStandsOnIsTakenBackAndTheOwnersGoesOn) {
  ASSERT_TRUE(Share("bob", v1::SHARE_ROLE_PLANNER).ok());
  const auto context = ContextOf(bob_);
  const auto drag = stubs_->deform->Deform(context.get());
  v1::DeformRequest request;
  request.mutable_configuration()->set_session(session_);
  ASSERT_TRUE(drag->Write(request));
  v1::DeformResponse response;
  ASSERT_TRUE(drag->Read(&response));
  ASSERT_TRUE(response.has_started());
  const auto own_context = ContextOf(ann_);
  const auto own = stubs_->deform->Deform(own_context.get());
  ASSERT_TRUE(own->Write(request));
  ASSERT_TRUE(own->Read(&response));
  ASSERT_TRUE(Unshare("bob").ok());
  while (drag->Read(&response)) {
  }
  EXPECT_EQ(drag->Finish().error_code(), Code::NOT_FOUND);
  own->WritesDone();
  while (own->Read(&response)) {
  }
  EXPECT_TRUE(own->Finish().ok());
}

TEST_F(AccessServiceTest, PlannerDemotedToViewerMayWatchButNotDrag) {
  ASSERT_TRUE(Share("bob", v1::SHARE_ROLE_PLANNER).ok());
  const auto context = ContextOf(bob_);
  std::string name;
  const auto watch = BeginWatch(context.get(), &name);
  const auto drag_context = ContextOf(bob_);
  const auto drag = stubs_->deform->Deform(drag_context.get());
  v1::DeformRequest request;
  request.mutable_configuration()->set_session(session_);
  ASSERT_TRUE(drag->Write(request));
  v1::DeformResponse response;
  ASSERT_TRUE(drag->Read(&response));
  ASSERT_TRUE(Share("bob", v1::SHARE_ROLE_VIEWER).ok());
  while (drag->Read(&response)) {
  }
  EXPECT_EQ(drag->Finish().error_code(), Code::PERMISSION_DENIED);
  EXPECT_TRUE(Acknowledge(bob_, name).ok()) << "the watch is there";
  ASSERT_TRUE(Unshare("bob").ok());
  EXPECT_EQ(EndOf(watch.get()).error_code(), Code::NOT_FOUND);
}

TEST_F(AccessServiceTest, OnlyTheWatcherMayAcknowledgeAWatch) {
  const auto context = ContextOf(ann_);
  std::string name;
  const auto watch = BeginWatch(context.get(), &name);
  EXPECT_TRUE(Acknowledge(ann_, name).ok());
  const grpc::Status foreign = Acknowledge(bob_, name);
  EXPECT_EQ(foreign.error_code(), Code::NOT_FOUND);
  context->TryCancel();
  EndOf(watch.get());
}

TEST_F(AccessServiceTest, AFollowLinkWatchesUntilItIsTakenBack) {
  v1::FollowLink link;
  ASSERT_TRUE(MakeLink({}, &link).ok());
  EXPECT_TRUE(link.has_expire_time());
  const Caller follower{.name = "follower", .link = link.token()};
  v1::Caller who;
  ASSERT_TRUE(stubs_->access->WhoAmI(ContextOf(follower).get(), {}, &who).ok());
  EXPECT_EQ(who.only_session(), session_);
  EXPECT_EQ(who.expire_time().seconds(), link.expire_time().seconds());
  const auto context = ContextOf(follower);
  std::string name;
  const auto watch = BeginWatch(context.get(), &name);
  EXPECT_TRUE(Acknowledge(follower, name).ok());
  v1::DeleteFollowLinksRequest request;
  request.set_session(session_);
  google::protobuf::Empty response;
  ASSERT_TRUE(stubs_->access->DeleteFollowLinks(ContextOf(ann_).get(), request, &response).ok());
  EXPECT_EQ(EndOf(watch.get()).error_code(), Code::UNAUTHENTICATED);
  EXPECT_EQ(stubs_->access->WhoAmI(ContextOf(follower).get(), {}, &who).error_code(),
            Code::UNAUTHENTICATED);
}

TEST_F(AccessServiceTest, ALinkLivesAsLongAsItIsAskedForWithinTheServersBounds) {
  v1::FollowLink link;
  for (const int64_t seconds : {int64_t{0}, int64_t{-1}, int64_t{24 * 7 * 3600 + 1}}) {
    v1::CreateFollowLinkRequest request;
    request.mutable_lifetime()->set_seconds(seconds);
    EXPECT_EQ(MakeLink(request, &link).error_code(), Code::INVALID_ARGUMENT) << seconds;
  }
  v1::CreateFollowLinkRequest request;
  request.mutable_lifetime()->set_seconds(24 * 7 * 3600);
  EXPECT_TRUE(MakeLink(request, &link).ok());
  request.set_case_("cases/none");
  EXPECT_EQ(MakeLink(request, &link).error_code(), Code::INVALID_ARGUMENT);
  request.set_case_("cases/" + std::string(64, 'a'));
  EXPECT_EQ(MakeLink(request, &link).error_code(), Code::NOT_FOUND);
}

TEST_F(AccessServiceTest, OnlyTheOwnerListsSharesAndSharesMustHaveARole) {
  EXPECT_EQ(Share("bob", v1::SHARE_ROLE_UNSPECIFIED).error_code(), Code::INVALID_ARGUMENT);
  ASSERT_TRUE(Share("bob", v1::SHARE_ROLE_VIEWER).ok());
  v1::ListSharesRequest request;
  request.set_resource(session_);
  v1::ListSharesResponse response;
  ASSERT_TRUE(stubs_->access->ListShares(ContextOf(ann_).get(), request, &response).ok());
  ASSERT_EQ(response.shares_size(), 1);
  EXPECT_EQ(response.shares(0).principal(), "bob");
  EXPECT_EQ(response.shares(0).role(), v1::SHARE_ROLE_VIEWER);
  EXPECT_EQ(stubs_->access->ListShares(ContextOf(bob_).get(), request, &response).error_code(),
            Code::PERMISSION_DENIED);
}

TEST_F(AccessServiceTest, AdminSeesUsageOfAllButNoContent) {
  const Caller admin{.name = "ADMIN", .link = ""};
  v1::GetUsageRequest request;
  request.set_principal("-");
  v1::Usage usage;
  ASSERT_TRUE(stubs_->access->GetUsage(ContextOf(admin).get(), request, &usage).ok());
  ASSERT_EQ(usage.principals_size(), 1);
  EXPECT_EQ(usage.principals(0).principal(), "ANN");
  EXPECT_EQ(usage.principals(0).sessions(), 1);
  EXPECT_EQ(usage.principals(0).stored_sessions(), 1);
  EXPECT_GT(usage.principals(0).memory_bytes(), 0);
  v1::GetSessionRequest session;
  session.set_name(session_);
  v1::Session found;
  EXPECT_EQ(stubs_->sessions->GetSession(ContextOf(admin).get(), session, &found).error_code(),
            Code::NOT_FOUND);
  EXPECT_EQ(stubs_->access->GetUsage(ContextOf(bob_).get(), request, &usage).error_code(),
            Code::PERMISSION_DENIED);
}

TEST_F(AccessServiceTest, RefusesEveryCallWithoutAToken) {
  grpc::ClientContext context;
  v1::Caller who;
  const grpc::Status status = stubs_->access->WhoAmI(&context, {}, &who);
  EXPECT_EQ(status.error_code(), Code::UNAUTHENTICATED);
  // Streams that need no place must ask as well.
  grpc::ClientContext of_case;
  v1::ReadCaseRequest read;
  read.set_name("cases/" + std::string(64, 'a'));
  EXPECT_EQ(stubs_->cases->ReadCase(&of_case, read)->Finish().error_code(), Code::UNAUTHENTICATED);
  grpc::ClientContext of_positions;
  v1::ReadPositionsRequest positions;
  positions.set_name("predictions/" + std::string(32, 'a'));
  EXPECT_EQ(stubs_->predictions->ReadPositions(&of_positions, positions)->Finish().error_code(),
            Code::UNAUTHENTICATED);
}

}  // namespace
}  // namespace tissueform::testing
