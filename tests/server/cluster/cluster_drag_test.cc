// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <atomic>
#include <memory>
#include <string>
#include <thread>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "client/cpp/client_call.h"
#include "core/base/error_reason.h"
#include "tests/server/cluster/cluster_test.h"
#include "tests/server/store/postgres_store/test_database.h"
#include "tests/testing/status_matchers.h"

// Drags of a session by one of several servers at a time.
namespace tissueform::testing {
namespace {

using ::testing::AnyOf;
using Code = absl::StatusCode;

// That another server holds the session, and which (empty: it does not say).
MATCHER_P(MovedTo, node, "") {
  const ErrorInfo info = ErrorInfoOf(GetStatus(arg));
  *result_listener << GetStatus(arg).ToString();
  const auto named = info.metadata.find("node");
  return HasReason(GetStatus(arg), ErrorReason::kSessionMoved) &&
         (named == info.metadata.end() ? "" : named->second) == std::string(node);
}

class ClusterDragTest : public ClusterTest {
 protected:
  // Its connections can be frozen: it is cut off from the database.
  void StartCutOff() {
    a_ = {};
    proxy_ = std::make_unique<FrozenProxy>(TestDatabasePort());
    ServerOptions options = NodeOptions("a");
    options.cluster.store =
        absl::StrCat("postgresql://postgres@127.0.0.1:", proxy_->port(), "/postgres");
    a_ = StartNode(options);
  }
  void TearDown() override {
    if (proxy_ != nullptr) proxy_->Thaw();
    a_ = {};
    b_ = {};
  }

  std::unique_ptr<FrozenProxy> proxy_;
};

TEST_F(ClusterDragTest, OtherNodesRedirectToTheHolderOfASession) {
  const std::string session = MakeSession(a_, 1);
  RawDrag drag(a_, session);
  ASSERT_TRUE(drag.Send(1));
  ASSERT_TRUE(drag.ReceiveFrame(1).has_value());
  EXPECT_THAT(AskOnce(b_, session, 2), MovedTo("a"));
  RawDrag other(b_, session);
  EXPECT_THAT(other.Finish(), MovedTo("a"));
  v1::DeleteSessionRequest remove;
  remove.set_name(session);
  google::protobuf::Empty nothing;
  EXPECT_THAT(FromGrpcStatus(b_.stubs->sessions->DeleteSession(As().get(), remove, &nothing)),
              MovedTo("a"));
  ASSERT_TRUE(drag.Send(3));
  EXPECT_TRUE(drag.ReceiveFrame(3).has_value());
  EXPECT_THAT(FromGrpcStatus(a_.stubs->sessions->DeleteSession(As().get(), remove, &nothing)),
              IsOk());
  EXPECT_THAT(AskOnce(b_, session, 4), StatusIs(Code::kNotFound));
}

TEST_F(ClusterDragTest, IsolatedHolderStopsAndAnotherNodeContinues) {
  StartCutOff();
  const std::string session = MakeSession(a_, 1);
  RawDrag drag(a_, session);
  ASSERT_TRUE(drag.Send(1, /*commit=*/true));
  ASSERT_TRUE(drag.WaitForCommit(1));
  const int64_t epoch = EpochOf(session);
  proxy_->FreezeAll();
  // Poses without end, until the stream does.
  uint64_t last_frame = 0;
  uint64_t sequence = 2;
  for (; drag.Send(sequence, sequence % 5 == 0); ++sequence) {
    const auto frame = drag.ReceiveFrame(sequence);
    if (!frame.has_value()) break;
    last_frame = frame->sequence();
  }
  EXPECT_GT(last_frame, 1U) << "as long as the lease allows";
  EXPECT_THAT(drag.Finish(), MovedTo(""));
  absl::Status taken;
  ASSERT_TRUE(Eventually([&] {
    taken = AskOnce(b_, session, 1).status();
    return taken.ok();
  })) << taken;
  EXPECT_GT(EpochOf(session), epoch);
  EXPECT_THAT(AskOnce(a_, session, 1), StatusIs(Code::kUnavailable));
  v1::GetSessionRequest get;
  get.set_name(session);
  v1::Session kept;
  ASSERT_THAT(FromGrpcStatus(b_.stubs->sessions->GetSession(As().get(), get, &kept)), IsOk());
  ASSERT_EQ(kept.committed_poses_size(), 1);
  EXPECT_EQ(kept.committed_poses(0).scale(), SomePose(1).scale)
      << "no commit of who was cut off was kept";
}

TEST_F(ClusterDragTest, ADrainedNodeGivesItsSessionsToTheOthersAtOnce) {
  const std::string session = MakeSession(a_, 1);
  RawDrag drag(a_, session);
  ASSERT_TRUE(drag.Send(1, /*commit=*/true));
  ASSERT_TRUE(drag.WaitForCommit(1));
  std::thread draining([&] { a_.server->Drain(); });
  const absl::Status end = drag.Finish();
  EXPECT_THAT(end, MovedTo(""));
  // A lease that had to run out would take longer than one that was given back, but that is not
  // measured here: only that b takes the session, and a holds no lease in the end.
  absl::Status taken;
  EXPECT_TRUE(Eventually([&] {
    taken = AskOnce(b_, session, 1).status();
    EXPECT_THAT(taken, AnyOf(IsOk(), MovedTo("a")));
    return taken.ok();
  }));
  draining.join();
  EXPECT_EQ(RunSql("SELECT count(*) FROM session_states WHERE node = 'a' AND lease_until > "
                   "tissueform_now()")
                .Integer(0, 0),
            0);
}

TEST_F(ClusterDragTest, FormerHolderStopsAnsweringAfterATakeover) {
  const std::string session = MakeSession(a_, 1);
  EXPECT_THAT(AskOnce(a_, session, 1), IsOk());
  RunSql("UPDATE session_states SET lease_until = '-infinity';");
  absl::Status taken;
  EXPECT_TRUE(Eventually([&] {
    taken = AskOnce(b_, session, 1).status();
    return taken.ok();
  })) << taken;
  // Its lease was cut short by hand; at the next renewal it knows.
  EXPECT_TRUE(Eventually([&] { return !AskOnce(a_, session, 1).ok(); }));
  EXPECT_THAT(AskOnce(a_, session, 1), MovedTo("b"));
}

TEST_F(ClusterDragTest, TakingAShareBackOnOneNodeEndsTheDragOnAnother) {
  const std::string session = MakeSession(a_, 1);
  v1::CreateShareRequest share;
  share.mutable_share()->set_resource(session);
  share.mutable_share()->set_principal("bob");
  share.mutable_share()->set_role(v1::SHARE_ROLE_PLANNER);
  v1::Share shared;
  ASSERT_THAT(FromGrpcStatus(b_.stubs->access->CreateShare(As().get(), share, &shared)), IsOk());
  v1::GetSessionRequest get;
  get.set_name(session);
  v1::Session seen;
  ASSERT_TRUE(
      Eventually([&] { return a_.stubs->sessions->GetSession(As("bob").get(), get, &seen).ok(); }));
  RawDrag drag(a_, session, "bob");
  ASSERT_TRUE(drag.Send(1));
  ASSERT_TRUE(drag.ReceiveFrame(1).has_value());
  v1::DeleteShareRequest unshare;
  unshare.set_resource(session);
  unshare.set_principal("bob");
  google::protobuf::Empty nothing;
  ASSERT_THAT(FromGrpcStatus(b_.stubs->access->DeleteShare(As().get(), unshare, &nothing)), IsOk());
  EXPECT_THAT(drag.Finish(), AnyOf(StatusIs(Code::kNotFound), StatusIs(Code::kPermissionDenied)));
}

}  // namespace
}  // namespace tissueform::testing
