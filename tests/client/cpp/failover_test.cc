// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <atomic>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "grpcpp/server.h"
#include "grpcpp/server_builder.h"
#include "gtest/gtest.h"

#include "client/cpp/backoff.h"
#include "client/cpp/reattaching_stream.h"
#include "client/cpp/reattaching_watch.h"
#include "client/cpp/tissueform_client.h"
#include "core/base/error_reason.h"
#include "core/base/mutex.h"
#include "proto/conversion/session_conversion.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr char kSession[] = "sessions/0123456789abcdef";
constexpr char kOwnName[] = "one:1";
constexpr std::chrono::minutes kPatience{2};

grpc::Status Refusal(grpc::StatusCode code, ErrorReason reason, const std::string& node) {
  google::rpc::ErrorInfo info;
  info.set_reason(std::string(ReasonName(reason)));
  info.set_domain("tissueform");
  if (!node.empty()) (*info.mutable_metadata())["node"] = node;
  google::rpc::Status details;
  details.set_code(code);
  details.add_details()->PackFrom(info);
  return {code, "refused", details.SerializeAsString()};
}
grpc::Status Moved(const std::string& node) {
  return Refusal(grpc::StatusCode::UNAVAILABLE, ErrorReason::kSessionMoved, node);
}

// What the servers of a cluster do behind one name: each call in its turn is answered as planned,
// and those beyond the plan well. Notes which server each call was meant for.
class Script {
 public:
  void Plan(std::vector<grpc::Status> answers) {
    MutexLock lock(mutex_);
    planned_.assign(answers.begin(), answers.end());
  }
  grpc::Status Take(grpc::ServerContext* context) {
    const auto node = context->client_metadata().find(kNodeHeader);
    if (says_name) context->AddInitialMetadata(kNodeHeader, kOwnName);
    MutexLock lock(mutex_);
    meant_.push_back(node == context->client_metadata().end()
                         ? "-"
                         : std::string(node->second.data(), node->second.size()));
    if (planned_.empty()) return grpc::Status::OK;
    const grpc::Status answer = planned_.front();
    planned_.pop_front();
    return answer;
  }
  std::vector<std::string> meant() const {
    MutexLock lock(mutex_);
    return meant_;
  }

  std::atomic<bool> says_name = true;

 private:
  mutable Mutex mutex_;
  std::deque<grpc::Status> planned_ ABSL_GUARDED_BY(mutex_);
  std::vector<std::string> meant_ ABSL_GUARDED_BY(mutex_);
};

class ScriptedSessions final : public v1::SessionService::Service {
 public:
  explicit ScriptedSessions(Script* script) : script_(script) {}

  grpc::Status CreateSession(grpc::ServerContext* context, const v1::CreateSessionRequest* request,
                             v1::Session* session) override {
    session->set_name(kSession);
    {
      MutexLock lock(mutex_);
      request_ids_.push_back(request->request_id());
    }
    return script_->Take(context);
  }
  grpc::Status GetSession(grpc::ServerContext* context, const v1::GetSessionRequest*,
                          v1::Session*) override {
    return script_->Take(context);
  }
  grpc::Status UpdateSession(grpc::ServerContext* context, const v1::UpdateSessionRequest*,
                             v1::Session*) override {
    return script_->Take(context);
  }
  grpc::Status DeleteSession(grpc::ServerContext* context, const v1::DeleteSessionRequest*,
                             google::protobuf::Empty*) override {
    return script_->Take(context);
  }
  std::vector<std::string> request_ids() const {
    MutexLock lock(mutex_);
    return request_ids_;
  }

 private:
  Script* const script_;
  mutable Mutex mutex_;
  std::vector<std::string> request_ids_ ABSL_GUARDED_BY(mutex_);
};

// Drags and watches: a stream that is answered well takes poses until its turn to end has come.
class ScriptedStreams final : public v1::DeformService::Service {
 public:
  explicit ScriptedStreams(Script* script) : script_(script) {}

  grpc::Status Deform(
      grpc::ServerContext* context,
      grpc::ServerReaderWriter<v1::DeformResponse, v1::DeformRequest>* stream) override {
    v1::DeformRequest request;
    stream->Read(&request);
    if (grpc::Status refusal = script_->Take(context); !refusal.ok()) return refusal;
    v1::DeformResponse response;
    response.mutable_started();
    stream->Write(response);
    while (stream->Read(&request)) {
      if (!request.has_pose()) continue;
      {
        MutexLock lock(mutex_);
        poses_.push_back(absl::StrCat(request.pose().sequence(),
                                      request.pose().commit() ? " to be committed" : ""));
      }
      if (request.pose().commit() && commits) {
        response.mutable_notice()->mutable_committed()->set_sequence(request.pose().sequence());
        stream->Write(response);
      }
      response.mutable_frame()->set_sequence(request.pose().sequence());
      stream->Write(response);
      if (std::optional<grpc::Status> end = TakeEnd(); end.has_value()) return *end;
    }
    return grpc::Status::OK;
  }

  grpc::Status Watch(grpc::ServerContext* context, const v1::WatchRequest*,
                     grpc::ServerWriter<v1::WatchResponse>* stream) override {
    if (grpc::Status refusal = script_->Take(context); !refusal.ok()) return refusal;
    v1::WatchResponse response;
    response.mutable_started()->set_watch("watches/0");
    stream->Write(response);
    response.mutable_frame()->set_number(1);
    stream->Write(response);
    return TakeEnd().value_or(grpc::Status::OK);
  }

  grpc::Status AcknowledgeWatch(grpc::ServerContext* context, const v1::AcknowledgeWatchRequest*,
                                google::protobuf::Empty*) override {
    return script_->Take(context);
  }

  // How the streams end that come next, each after its first frame.
  void PlanEnds(std::vector<grpc::Status> ends) {
    MutexLock lock(mutex_);
    ends_.assign(ends.begin(), ends.end());
  }
  std::vector<std::string> poses() const {
    MutexLock lock(mutex_);
    return poses_;
  }

  std::atomic<bool> commits = true;  // what is to be committed is, and the client is told

 private:
  std::optional<grpc::Status> TakeEnd() {
    MutexLock lock(mutex_);
    if (ends_.empty()) return std::nullopt;
    const grpc::Status end = ends_.front();
    ends_.pop_front();
    return end;
  }

  Script* const script_;
  mutable Mutex mutex_;
  std::deque<grpc::Status> ends_ ABSL_GUARDED_BY(mutex_);
  std::vector<std::string> poses_ ABSL_GUARDED_BY(mutex_);
};

// Hears of exports until its turn to end has come.
class ScriptedExports final : public v1::ExportService::Service {
 public:
  explicit ScriptedExports(Script* script) : script_(script) {}

  grpc::Status WatchExports(grpc::ServerContext* context, const v1::WatchExportsRequest*,
                            grpc::ServerWriter<v1::WatchExportsResponse>* stream) override {
    const grpc::Status end = script_->Take(context);
    stream->Write({});
    return end;
  }

 private:
  Script* const script_;
};

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
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<TissueformClient> client_;
  int detached_ = 0;
};

const grpc::Status kLost(grpc::StatusCode::UNAVAILABLE, "the connection is gone");
const grpc::Status kNotFound(grpc::StatusCode::NOT_FOUND, "no session");

TEST_F(FailoverTest, TheServerThatAnsweredIsMeantFromThenOn) {
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  EXPECT_TRUE(client_->OpenStream(kSession, {}).ok());
  EXPECT_TRUE(client_->GetSession("sessions/another").ok());
  EXPECT_THAT(script_.meant(), ElementsAre("-", kOwnName, kOwnName, "-"));
}

TEST_F(FailoverTest, ANewSessionIsWhereItWasMade) {
  EXPECT_TRUE(client_->CreateSession(SomeRequest()).ok());
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  EXPECT_THAT(script_.meant(), ElementsAre("-", kOwnName));
}

TEST_F(FailoverTest, ASessionThatHasMovedIsAskedForWhereItIs) {
  script_.Plan({Moved("two:1"), Moved("three:1")});
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  EXPECT_THAT(script_.meant(), ElementsAre("-", "two:1", "three:1"));
}

TEST_F(FailoverTest, ALargeSessionGoesWhereThereIsRoom) {
  script_.Plan(
      {Refusal(grpc::StatusCode::RESOURCE_EXHAUSTED, ErrorReason::kMemoryBudgetFull, "two:1")});
  EXPECT_TRUE(client_->CreateSession(SomeRequest()).ok());
  EXPECT_THAT(script_.meant(), ElementsAre("-", "two:1"));
}

TEST_F(FailoverTest, AReadIsRepeatedWithoutTheServerThatIsGone) {
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  script_.Plan({kLost, Refusal(grpc::StatusCode::UNAVAILABLE, ErrorReason::kWrongNode, "")});
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  EXPECT_THAT(script_.meant(), ElementsAre("-", kOwnName, "-", "-"));
}

TEST_F(FailoverTest, WhatMayHaveBeenDoneIsNotDoneTwice) {
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  script_.Plan({kLost});
  v1::UpdateSessionRequest request;
  request.set_name(kSession);
  request.set_etag("1");
  EXPECT_TRUE(absl::IsUnavailable(client_->UpdateSession(request).status()));
  script_.Plan({Moved("two:1")});
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

TEST_F(FailoverTest, WhatALostCallHasDeletedIsDeleted) {
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  script_.Plan({kLost, kNotFound});
  EXPECT_TRUE(client_->DeleteSession(kSession).ok());
  script_.Plan({kNotFound});
  EXPECT_TRUE(absl::IsNotFound(client_->DeleteSession(kSession)));
}

TEST_F(FailoverTest, AServerAloneIsNotAskedAgain) {
  script_.says_name = false;
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  script_.Plan({kLost});
  EXPECT_TRUE(absl::IsUnavailable(client_->GetSession(kSession).status()));
  EXPECT_THAT(script_.meant(), ElementsAre("-", "-"));
}

TEST_F(FailoverTest, ADragGoesOnWhereItsSessionIs) {
  streams_.PlanEnds({Moved("two:1")});
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
  script_.Plan({Moved(""), kLost});
  drag->SendPoses(1, {});
  EXPECT_EQ(drag->Receive()->sequence(), 1U);
  EXPECT_EQ(drag->Receive()->sequence(), 1U);
  EXPECT_THAT(script_.meant(), ElementsAre("-", "-", "-", "-"));
  EXPECT_EQ(drag->reattachments(), 1);
  drag->Cancel();
}

TEST_F(FailoverTest, WhatIsCommittedIsNotSentAgain) {
  streams_.PlanEnds({Moved("")});
  const auto drag = OpenDrag();
  ASSERT_NE(drag, nullptr);
  drag->SendPoses(1, {}, /*commit=*/true);
  EXPECT_TRUE(drag->Receive().has_value());
  EXPECT_TRUE(drag->Receive().has_value());
  EXPECT_EQ(drag->last_committed(), 1U);
  EXPECT_THAT(streams_.poses(), ElementsAre("1 to be committed", "1"));
  drag->Cancel();
}

TEST_F(FailoverTest, WhatWasNotCommittedIsSentUntilItIs) {
  streams_.commits = false;
  streams_.PlanEnds({Moved("")});
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
  streams_.PlanEnds({Moved("")});
  const auto drag = OpenDrag();
  ASSERT_NE(drag, nullptr);
  script_.Plan({kNotFound});
  drag->SendPoses(1, {});
  EXPECT_TRUE(drag->Receive().has_value());
  EXPECT_EQ(drag->Receive(), std::nullopt);
  EXPECT_TRUE(absl::IsNotFound(drag->Finish()));
}

TEST_F(FailoverTest, AWatchGoesOnWhereItsSessionIs) {
  streams_.PlanEnds({Moved("two:1"), kNotFound});
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

TEST_P(ProxiedFailoverTest, ADragGoesOnWhereTheReasonSays) {
  streams_.PlanEnds({AsProxied(Moved("two:1")), AsProxied(kCutOff)});
  const auto drag = OpenDrag();
  ASSERT_NE(drag, nullptr);
  drag->SendPoses(1, {});
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(drag->Receive().has_value()) << i;
  EXPECT_THAT(script_.meant(), ElementsAre("-", "two:1", "-"));
  drag->Cancel();
  EXPECT_EQ(drag->Receive(), std::nullopt);
  EXPECT_TRUE(absl::IsCancelled(drag->Finish())) << "it was";
}

TEST_P(ProxiedFailoverTest, AWatchDoesToo) {
  streams_.PlanEnds({AsProxied(Moved("two:1")), AsProxied(kCutOff), kNotFound});
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

TEST_P(ProxiedFailoverTest, ACallThatMayBeRepeatedIs) {
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  script_.Plan({AsProxied(kCutOff)});
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  EXPECT_THAT(script_.meant(), ElementsAre("-", kOwnName, "-"));
}

TEST_P(ProxiedFailoverTest, WhatWasRefusedBeforeItBeganIsRepeatedWhateverItIs) {
  EXPECT_TRUE(client_->GetSession(kSession).ok());
  v1::UpdateSessionRequest request;
  request.set_name(kSession);
  request.set_etag("1");
  for (const ErrorReason reason :
       {ErrorReason::kSessionMoved, ErrorReason::kWrongNode, ErrorReason::kServerDraining}) {
    script_.Plan({AsProxied(Refusal(grpc::StatusCode::UNAVAILABLE, reason, ""))});
    EXPECT_TRUE(client_->UpdateSession(request).ok()) << ReasonName(reason);
  }
}

TEST_P(ProxiedFailoverTest, WhatTheServerRefusesForGoodIsSaidAsTheServerSaidIt) {
  script_.Plan(
      {AsProxied(Refusal(grpc::StatusCode::NOT_FOUND, ErrorReason::kSessionNotFound, ""))});
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
