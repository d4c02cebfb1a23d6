// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <chrono>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "client/cpp/client_call.h"
#include "core/base/error_reason.h"
#include "proto/conversion/geometry_conversion.h"
#include "proto/conversion/session_conversion.h"
#include "tests/server/cluster/cluster_test.h"
#include "tests/server/store/postgres_store/test_database.h"
#include "tests/testing/status_matchers.h"

// What calls are answered, and when, while the database is away.
namespace tissueform::testing {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using Code = absl::StatusCode;

// In plain words, and without a word of which database it is.
MATCHER(SaysThatTheDatabaseIsAway, "") {
  const absl::Status& status = GetStatus(arg);
  *result_listener << status.ToString();
  return ExplainMatchResult(
      AllOf(StatusIs(Code::kUnavailable, HasSubstr("the server's database does not answer")),
            Not(StatusIs(Code::kUnavailable, HasSubstr("://"))),
            Not(StatusIs(Code::kUnavailable, HasSubstr("host"))),
            Not(StatusIs(Code::kUnavailable, HasSubstr("port"))),
            Not(StatusIs(Code::kUnavailable, HasSubstr("postgres"))),
            Not(StatusIs(Code::kUnavailable, HasSubstr("FATAL"))),
            Not(StatusIs(Code::kUnavailable, HasSubstr("libpq")))),
      status, result_listener);
}

class ClusterAwayTest : public ClusterTest {
 protected:
  // On a database of its own, whose door the test shuts. Leases last as long as the test.
  void Start(milliseconds patience) {
    a_ = {};
    b_ = {};
    RunOutsideTransaction("DROP DATABASE IF EXISTS away WITH (FORCE)");
    RunOutsideTransaction("CREATE DATABASE away");
    ServerOptions options = NodeOptions("a");
    options.cluster.store = TestDatabaseOptions("away").url;
    options.cluster.limits.patience = patience;
    options.cluster.lease = {.duration = seconds(120)};
    a_ = StartNode(options);
    session_ = MakeSession(a_, 1);
  }
  void TearDown() override {
    if (session_.empty()) return;
    ComeBack();
    a_ = {};
  }
  static void GoAway() {
    RunOutsideTransaction("ALTER DATABASE away ALLOW_CONNECTIONS false");
    RunSql("SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity WHERE datname = 'away'");
  }
  static void ComeBack() { RunOutsideTransaction("ALTER DATABASE away ALLOW_CONNECTIONS true"); }
  // Until the server has asked in vain.
  void WaitUntilNoticed() {
    const CountedLeases::Counts& counts = a_.server->cluster()->node().leases().counts();
    const int64_t failed = counts.renewals_failed;
    EXPECT_TRUE(Eventually([&] { return counts.renewals_failed > failed; }));
  }

  std::unique_ptr<grpc::ClientContext> Context() const {
    auto context = As();
    context->set_deadline(std::chrono::system_clock::now() + call_deadline_);
    return context;
  }
  void Begin(const std::string& name, std::function<absl::Status()> call) {
    calls_[name] = std::async(std::launch::async, std::move(call));
  }
  void BeginPrediction(int number) {
    Begin(absl::StrCat("a prediction ", number), [this, number] {
      v1::CreatePredictionRequest request;
      request.set_session(session_);
      for (const NamedPose& named : TopPose(SomePose(number))) {
        *request.add_poses() = ToProto(named);
      }
      v1::Prediction prediction;
      return FromGrpcStatus(
          a_.stubs->predictions->CreatePrediction(Context().get(), request, &prediction));
    });
  }
  void BeginSession(const std::string& id) {
    Begin(absl::StrCat("a session ", id), [this, id] {
      const SentMesh mesh(1);
      SessionRequest request = mesh.problem.Request(mesh.name);
      request.session_id = id;
      v1::Session session;
      return FromGrpcStatus(
          a_.stubs->sessions->CreateSession(Context().get(), ToProto(request), &session));
    });
  }
  void BeginMesh(uint32_t seed) {
    Begin(absl::StrCat("a mesh ", seed), [this, seed] {
      v1::UploadMeshResponse sent;
      return FromGrpcStatus(
          SendMesh(*a_.stubs, {.name = "ann", .link = ""}, SentMesh(seed), &sent).status);
    });
  }

  seconds call_deadline_{60};
  std::string session_;
  std::map<std::string, std::future<absl::Status>> calls_;  // last: they use the others
};

TEST_F(ClusterAwayTest, WritesWaitForADatabaseThatComesBack) {
  Start(seconds(30));
  RawDrag drag(a_, session_);
  ASSERT_TRUE(drag.Send(1, /*commit=*/true));
  ASSERT_TRUE(drag.WaitForCommit(1));
  GoAway();
  BeginPrediction(1);
  BeginSession("");
  BeginSession("0123456789abcdef");
  BeginMesh(2);
  ASSERT_TRUE(drag.Send(2, /*commit=*/true));
  EXPECT_TRUE(drag.ReceiveFrame(2).has_value()) << "poses are answered meanwhile";
  WaitUntilNoticed();
  ComeBack();
  EXPECT_TRUE(drag.WaitForCommit(2));
  for (auto& [name, call] : calls_) EXPECT_THAT(call.get(), IsOk()) << name;
}

// Many more than there are threads: those that wait for one do not get their error later.
TEST_F(ClusterAwayTest, AllWritesReportADatabaseThatStaysAwayBeforeTheirDeadline) {
  Start(seconds(3));
  RawDrag drag(a_, session_);
  ASSERT_TRUE(drag.Send(1, /*commit=*/true));
  ASSERT_TRUE(drag.WaitForCommit(1));
  GoAway();
  call_deadline_ = seconds(15);
  for (int i = 0; i < 16; ++i) BeginPrediction(i);
  BeginSession("");
  BeginSession("0123456789abcdef");
  BeginMesh(2);
  Begin("a share", [this] {
    v1::CreateShareRequest request;
    request.mutable_share()->set_resource(session_);
    request.mutable_share()->set_principal("bob");
    request.mutable_share()->set_role(v1::SHARE_ROLE_VIEWER);
    v1::Share share;
    return FromGrpcStatus(a_.stubs->access->CreateShare(Context().get(), request, &share));
  });
  ASSERT_TRUE(drag.Send(2, /*commit=*/true));
  for (auto& [name, call] : calls_) EXPECT_THAT(call.get(), SaysThatTheDatabaseIsAway()) << name;
  EXPECT_EQ(drag.NextCommitsFailure(),
            "the server's database does not answer; try again in a minute");
  EXPECT_THAT(AskOnce(a_, session_, 1), IsOk()) << "poses are answered as long as the lease lasts";
}

TEST_F(ClusterAwayTest, AServerThatEndsDoesNotWaitForIt) {
  Start(seconds(600));
  GoAway();
  for (int i = 0; i < 6; ++i) BeginPrediction(i);
  BeginSession("0123456789abcdef");
  BeginMesh(2);
  WaitUntilNoticed();
  std::future<void> end = std::async(std::launch::async, [this] {
    a_.server->Drain();
    a_.server.reset();
  });
  EXPECT_EQ(end.wait_for(seconds(50)), std::future_status::ready) << "the drain takes 8 s at most";
  for (auto& [name, call] : calls_) EXPECT_THAT(call.get(), StatusIs(Code::kUnavailable)) << name;
}

}  // namespace
}  // namespace tissueform::testing
