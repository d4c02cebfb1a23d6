// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "grpcpp/server.h"
#include "grpcpp/server_builder.h"
#include "gtest/gtest.h"

#include "client/cpp/reattaching_stream.h"
#include "client/cpp/reattaching_watch.h"
#include "client/cpp/tissueform_client.h"
#include "core/base/backoff.h"
#include "core/base/error_reason.h"
#include "core/mesh/payload/sha256.h"
#include "proto/conversion/case_conversion.h"
#include "tests/client/cpp/scripted_services.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr std::chrono::minutes kPatience{2};

SessionRequest SomeRequest() {
  SessionRequest request;
  request.stiffness = 1e3;
  return request;
}

class FailoverTest : public ::testing::Test {
 protected:
  void SetUp() override {
    grpc::ServerBuilder builder;
    int port = 0;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
    builder.RegisterService(&sessions_);
    builder.RegisterService(&streams_);
    builder.RegisterService(&exports_);
    builder.RegisterService(&cases_);
    builder.RegisterService(&predictions_);
    server_ = builder.BuildAndStart();
    ASSERT_NE(server_, nullptr);
    ASSERT_OK_AND_ASSIGN(client_, TissueformClient::Connect(absl::StrCat("127.0.0.1:", port), {}));
  }
  void TearDown() override { server_->Shutdown(); }

  std::unique_ptr<ReattachingStream> OpenDrag() {
    ReattachingStream::Options options;
    options.reattachment = {.give_up_after = kPatience,
                            .on_detached = [this](const absl::Status&) { ++detached_; }};
    auto drag = ReattachingStream::Open(client_.get(), kSession, options);
    EXPECT_TRUE(drag.ok()) << drag.status();
    return drag.ok() ? *std::move(drag) : nullptr;
  }

  Script script_;
  ScriptedSessions sessions_{&script_};
  ScriptedStreams streams_{&script_};
  ScriptedExports exports_{&script_};
  ScriptedCases cases_{&script_};
  ScriptedPredictions predictions_{&script_};
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<TissueformClient> client_;
  int detached_ = 0;
};

const grpc::Status kLost(grpc::StatusCode::UNAVAILABLE, "the connection is gone");
const grpc::Status kNotFound(grpc::StatusCode::NOT_FOUND, "no session");

TEST_F(FailoverTest, LaterCallsGoToTheServerThatAnswered) {
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  EXPECT_TRUE(client_->OpenStream(kSession, {}).ok());
  EXPECT_TRUE(client_->GetSession("sessions/another").ok());
  EXPECT_THAT(script_.meant(), ElementsAre("-", kOwnName, kOwnName, "-"));
}

TEST_F(FailoverTest, LooksForANewSessionWhereItWasCreated) {
  EXPECT_TRUE(client_->CreateSession(SomeRequest()).ok());
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  EXPECT_THAT(script_.meant(), ElementsAre("-", kOwnName));
}

TEST_F(FailoverTest, FollowsASessionThatHasMoved) {
  script_.Plan({MovedTo("two:1"), MovedTo("three:1")});
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  EXPECT_THAT(script_.meant(), ElementsAre("-", "two:1", "three:1"));
}

TEST_F(FailoverTest, ALargeSessionGoesWhereThereIsRoom) {
  script_.Plan(
      {RefusalFor(grpc::StatusCode::RESOURCE_EXHAUSTED, ErrorReason::kMemoryBudgetFull, "two:1")});
  EXPECT_TRUE(client_->CreateSession(SomeRequest()).ok());
  EXPECT_THAT(script_.meant(), ElementsAre("-", "two:1"));
}

TEST_F(FailoverTest, AReadIsRepeatedWithoutTheServerThatIsGone) {
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  script_.Plan({kLost, RefusalFor(grpc::StatusCode::UNAVAILABLE, ErrorReason::kWrongNode, "")});
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  EXPECT_THAT(script_.meant(), ElementsAre("-", kOwnName, "-", "-"));
}

TEST_F(FailoverTest, DoesNotRepeatAnUpdateThatMayHaveHappened) {
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  script_.Plan({kLost});
  v1::UpdateSessionRequest request;
  request.set_name(kSession);
  request.set_etag("1");
  EXPECT_TRUE(absl::IsUnavailable(client_->UpdateSession(request).status()));
  script_.Plan({MovedTo("two:1")});
  EXPECT_TRUE(client_->UpdateSession(request).ok());
}

TEST_F(FailoverTest, ASessionIsMadeOnceWhenTheReplyIsLost) {
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  script_.Plan({kLost});
  EXPECT_TRUE(client_->CreateSession(SomeRequest()).ok());
  const std::vector<std::string> ids = sessions_.request_ids();
  ASSERT_EQ(ids.size(), 2U);
  EXPECT_EQ(ids[0], ids[1]);
  EXPECT_NE(ids[0], "");
}

TEST_F(FailoverTest, RepeatedDeleteAfterALostReplySucceeds) {
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  script_.Plan({kLost, kNotFound});
  EXPECT_TRUE(client_->DeleteSession(kSession).ok());
  script_.Plan({kNotFound});
  EXPECT_TRUE(absl::IsNotFound(client_->DeleteSession(kSession)));
}

TEST_F(FailoverTest, CasesAndExportsAreFoundAlthoughAServerIsLost) {
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  const std::string name = CaseName(Sha256Hex({kCaseBytes}));
  script_.Plan({kLost});
  EXPECT_THAT(client_->cases().Get(name).status(), IsOk());
  script_.Plan({kLost});
  EXPECT_THAT(client_->cases().List().status(), IsOk());
  script_.Plan({kLost});
  EXPECT_THAT(client_->exports().Get("exports/a").status(), IsOk());
  script_.Plan({kLost});
  EXPECT_THAT(client_->exports().List().status(), IsOk());
  script_.Plan({kLost});
  EXPECT_THAT(client_->exports().Create("predictions/a", {}, "id").status(), IsOk());
}

TEST_F(FailoverTest, ACaseIsReadAlthoughAServerIsLostBeforeItsFirstByte) {
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  script_.Plan({kLost, kLost});
  ASSERT_OK_AND_ASSIGN(const std::string bytes,
                       client_->cases().Read(CaseName(Sha256Hex({kCaseBytes}))));
  EXPECT_EQ(bytes, kCaseBytes);
}

TEST_F(FailoverTest, RepeatedDeleteSucceedsForEveryResourceKind) {
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  const std::vector<std::function<absl::Status()>> deletions = {
      [&] { return client_->cases().Delete(CaseName(Sha256Hex({kCaseBytes}))); },
      [&] { return client_->predictions().Delete("predictions/a"); },
      [&] { return client_->exports().Delete("exports/a"); }};
  for (const auto& deletion : deletions) {
    script_.Plan({kLost, kNotFound});
    EXPECT_THAT(deletion(), IsOk());
    script_.Plan({kNotFound});
    EXPECT_TRUE(absl::IsNotFound(deletion()));
  }
}

TEST_F(FailoverTest, AnExportIsNotChangedTwice) {
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  script_.Plan({kLost});
  EXPECT_TRUE(absl::IsUnavailable(client_->exports().Update({}).status()));
  script_.Plan({kLost});
  EXPECT_TRUE(absl::IsUnavailable(client_->exports().Create("predictions/a").status()));
  script_.Plan({RefusalFor(grpc::StatusCode::UNAVAILABLE, ErrorReason::kServerDraining, "")});
  EXPECT_THAT(client_->exports().Update({}).status(), IsOk());
}

TEST_F(FailoverTest, DoesNotRetryAStandaloneServer) {
  script_.says_name = false;
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  script_.Plan({kLost});
  EXPECT_TRUE(absl::IsUnavailable(client_->GetSession(kSession).status()));
  EXPECT_THAT(script_.meant(), ElementsAre("-", "-"));
}

TEST_F(FailoverTest, ADragGoesOnWhereItsSessionIs) {
  streams_.PlanEnds({MovedTo("two:1")});
  const auto drag = OpenDrag();
  ASSERT_NE(drag, nullptr);
  drag->SendPoses(1, {});
  EXPECT_EQ(drag->Receive()->sequence(), 1U);
  EXPECT_EQ(drag->Receive()->sequence(), 1U) << "the newest pose, once more";
  EXPECT_THAT(script_.meant(), ElementsAre("-", "two:1"));
  EXPECT_EQ(detached_, 1);
  drag->CloseSending();
  EXPECT_EQ(drag->Receive(), std::nullopt);
  EXPECT_THAT(drag->Finish(), IsOk());
}

TEST_F(FailoverTest, ADragOutlivesItsServerAndARefusalOfTheNext) {
  streams_.PlanEnds({kLost});
  const auto drag = OpenDrag();
  ASSERT_NE(drag, nullptr);
  script_.Plan({MovedTo(""), kLost});
  drag->SendPoses(1, {});
  EXPECT_EQ(drag->Receive()->sequence(), 1U);
  EXPECT_EQ(drag->Receive()->sequence(), 1U);
  EXPECT_THAT(script_.meant(), ElementsAre("-", "-", "-", "-"));
  EXPECT_EQ(drag->reattachments(), 1);
  drag->Cancel();
}

TEST_F(FailoverTest, DoesNotResendACommittedPoseAsACommit) {
  streams_.PlanEnds({MovedTo("")});
  const auto drag = OpenDrag();
  ASSERT_NE(drag, nullptr);
  drag->SendPoses(1, {}, /*commit=*/true);
  EXPECT_TRUE(drag->Receive().has_value());
  EXPECT_TRUE(drag->Receive().has_value());
  EXPECT_EQ(drag->last_committed(), 1U);
  EXPECT_THAT(streams_.poses(), ElementsAre("1 to be committed", "1"));
  drag->Cancel();
}

TEST_F(FailoverTest, ResendsACommitUntilItIsAcknowledged) {
  streams_.commits = false;
  streams_.PlanEnds({MovedTo("")});
  const auto drag = OpenDrag();
  ASSERT_NE(drag, nullptr);
  drag->SendPoses(1, {}, /*commit=*/true);
  EXPECT_TRUE(drag->Receive().has_value());
  streams_.commits = true;
  EXPECT_TRUE(drag->Receive().has_value());
  EXPECT_THAT(streams_.poses(), ElementsAre("1 to be committed", "1 to be committed"));
  EXPECT_EQ(drag->last_committed(), 1U);
  drag->Cancel();
}

TEST_F(FailoverTest, ADragWhoseSessionIsGoneEnds) {
  streams_.PlanEnds({MovedTo("")});
  const auto drag = OpenDrag();
  ASSERT_NE(drag, nullptr);
  script_.Plan({kNotFound});
  drag->SendPoses(1, {});
  EXPECT_TRUE(drag->Receive().has_value());
  EXPECT_EQ(drag->Receive(), std::nullopt);
  EXPECT_TRUE(absl::IsNotFound(drag->Finish()));
}

TEST_F(FailoverTest, AWatchGoesOnWhereItsSessionIs) {
  streams_.PlanEnds({MovedTo("two:1"), kNotFound});
  ASSERT_OK_AND_ASSIGN(const auto watch, ReattachingWatch::Open(client_.get(), kSession, {}));
  EXPECT_TRUE(watch->Receive().has_value());
  const std::optional<v1::WatchFrame> again = watch->Receive();
  ASSERT_TRUE(again.has_value());
  EXPECT_EQ(again->number(), 1U);
  EXPECT_EQ(watch->reattachments(), 1);
  EXPECT_EQ(watch->Receive(), std::nullopt);
  EXPECT_TRUE(absl::IsNotFound(watch->Finish()));
  EXPECT_THAT(script_.meant(), ElementsAre("-", "two:1"));
}

TEST_F(FailoverTest, WatchReportsFallingBackFromADragToACommittedPose) {
  constexpr auto kDrag = v1::WATCH_ORIGIN_DRAG;
  constexpr auto kCommitted = v1::WATCH_ORIGIN_COMMITTED;
  streams_.PlanOrigins({{v1::WATCH_ORIGIN_REST, kDrag},
                        {kCommitted},
                        {kCommitted, kDrag, v1::WATCH_ORIGIN_REST},
                        {kCommitted}});
  streams_.PlanEnds({MovedTo("two:1"), MovedTo("three:1"), MovedTo("two:1"), kNotFound});
  ASSERT_OK_AND_ASSIGN(const auto watch, ReattachingWatch::Open(client_.get(), kSession, {}));
  std::vector<bool> falls_back;
  while (watch->Receive().has_value()) falls_back.push_back(watch->falls_back());
  EXPECT_THAT(falls_back, ElementsAre(false, false, true, true, false, false, false));
}

TEST_F(FailoverTest, AFrameIsAcknowledgedWhereItCameFrom) {
  ASSERT_OK_AND_ASSIGN(const auto watch, client_->Watch(kSession, {}));
  const std::optional<v1::WatchFrame> frame = watch->Receive();
  ASSERT_TRUE(frame.has_value());
  EXPECT_THAT(watch->Ack(*frame), IsOk());
  EXPECT_THAT(script_.meant(), ElementsAre("-", kOwnName));
}

// Through a proxy an error that ends a call early arrives under another code, with the server's
// details or without any.
class ProxiedFailoverTest : public FailoverTest,
                            public ::testing::WithParamInterface<grpc::StatusCode> {
 protected:
  grpc::Status AsProxied(const grpc::Status& error) const {
    return {GetParam(), "Received RST_STREAM with error code 8", error.error_details()};
  }
};

const grpc::Status kCutOff(grpc::StatusCode::UNAVAILABLE, "");

TEST_P(ProxiedFailoverTest, DragContinuesOnTheServerThatTheErrorNames) {
  streams_.PlanEnds({AsProxied(MovedTo("two:1")), AsProxied(kCutOff)});
  const auto drag = OpenDrag();
  ASSERT_NE(drag, nullptr);
  drag->SendPoses(1, {});
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(drag->Receive().has_value()) << i;
  EXPECT_THAT(script_.meant(), ElementsAre("-", "two:1", "-"));
  drag->Cancel();
  EXPECT_EQ(drag->Receive(), std::nullopt);
  EXPECT_TRUE(absl::IsCancelled(drag->Finish())) << "it was";
}

TEST_P(ProxiedFailoverTest, WatchContinuesOnTheServerThatTheErrorNames) {
  streams_.PlanEnds({AsProxied(MovedTo("two:1")), AsProxied(kCutOff), kNotFound});
  ASSERT_OK_AND_ASSIGN(const auto watch, ReattachingWatch::Open(client_.get(), kSession, {}));
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(watch->Receive().has_value()) << i;
  EXPECT_EQ(watch->Receive(), std::nullopt);
  EXPECT_THAT(script_.meant(), ElementsAre("-", "two:1", "-"));
}

TEST_P(ProxiedFailoverTest, AWatchOfExportsThatWasCutOffMayBeBegunAgain) {
  script_.Plan({AsProxied(kCutOff)});
  const auto watch = client_->exports().Watch();
  EXPECT_TRUE(watch->Receive().has_value());
  EXPECT_EQ(watch->Receive(), std::nullopt);
  const absl::Status end = watch->Finish();
  EXPECT_TRUE(IsTransient(end)) << end;
}

TEST_P(ProxiedFailoverTest, RepeatsAnIdempotentCall) {
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  script_.Plan({AsProxied(kCutOff)});
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  EXPECT_THAT(script_.meant(), ElementsAre("-", kOwnName, "-"));
}

TEST_P(ProxiedFailoverTest, RepeatsAnyCallRefusedBeforeItBegan) {
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  v1::UpdateSessionRequest request;
  request.set_name(kSession);
  request.set_etag("1");
  for (const ErrorReason reason :
       {ErrorReason::kSessionMoved, ErrorReason::kWrongNode, ErrorReason::kServerDraining}) {
    script_.Plan({AsProxied(RefusalFor(grpc::StatusCode::UNAVAILABLE, reason, ""))});
    EXPECT_TRUE(client_->UpdateSession(request).ok()) << ReasonName(reason);
  }
}

TEST_P(ProxiedFailoverTest, PermanentRefusalKeepsTheServersStatus) {
  script_.Plan(
      {AsProxied(RefusalFor(grpc::StatusCode::NOT_FOUND, ErrorReason::kSessionNotFound, ""))});
  const absl::Status refused = client_->GetSession(kSession).status();
  EXPECT_TRUE(absl::IsNotFound(refused)) << refused;
  EXPECT_TRUE(HasReason(refused, ErrorReason::kSessionNotFound)) << refused;
}

std::string NameOfCode(const ::testing::TestParamInfo<grpc::StatusCode>& code) {
  return absl::StatusCodeToString(static_cast<absl::StatusCode>(code.param));
}
INSTANTIATE_TEST_SUITE_P(Codes, ProxiedFailoverTest,
                         ::testing::Values(grpc::StatusCode::CANCELLED, grpc::StatusCode::UNKNOWN,
                                           grpc::StatusCode::INTERNAL,
                                           grpc::StatusCode::UNAVAILABLE),
                         NameOfCode);

}  // namespace
}  // namespace tissueform::testing
