// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <memory>
#include <string>

#include "gmock/gmock.h"
#include "google/protobuf/util/time_util.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "gtest/gtest.h"

#include "proto/conversion/geometry_conversion.h"
#include "proto/conversion/session_conversion.h"
#include "tests/integration/access_calls.h"
#include "tests/integration/service_test.h"

// What one principal may take, and that no other one is affected.
namespace tissueform::testing {
namespace {

using Caller = AccessWorld::Caller;
using Code = grpc::StatusCode;
using ::testing::HasSubstr;

class QuotasTest : public ServiceTest {
 protected:
  void Start(const Quotas& quotas) {
    ServerOptions options = TestOptions();
    options.quotas = quotas;
    StartServer(options, &callers_);
    stubs_ = std::make_unique<Stubs>(OwnChannel());
  }
  void TearDown() override {
    stubs_.reset();
    StopServer();
  }

  grpc::Status CreateSession(const Caller& caller, const SentMesh& mesh, v1::Session* session) {
    return stubs_->sessions->CreateSession(ContextOf(caller).get(),
                                           ToProto(mesh.problem.Request(mesh.name)), session);
  }

  const Caller ann_{.name = "ANN", .link = ""};
  const Caller bob_{.name = "BOB", .link = ""};
  NamedCallers callers_;
  std::unique_ptr<Stubs> stubs_;
};

// RESOURCE_EXHAUSTED by this quota, with a time after which it is worth trying again.
void ExpectRefused(const grpc::Status& status, const std::string& quota) {
  EXPECT_EQ(status.error_code(), Code::RESOURCE_EXHAUSTED) << status.error_message();
  EXPECT_THAT(status.error_message(), HasSubstr("--quota-" + quota));
  google::rpc::Status details;
  ASSERT_TRUE(details.ParseFromString(status.error_details()));
  ASSERT_EQ(details.details_size(), 2);
  google::rpc::ErrorInfo info;
  ASSERT_TRUE(details.details(0).UnpackTo(&info));
  EXPECT_EQ(info.reason(), "QUOTA_EXCEEDED");
  EXPECT_EQ(info.metadata().at("quota"), quota);
  google::rpc::RetryInfo retry;
  ASSERT_TRUE(details.details(1).UnpackTo(&retry));
  EXPECT_GT(google::protobuf::util::TimeUtil::DurationToMilliseconds(retry.retry_delay()), 0);
}

TEST_F(QuotasTest, SessionsAreThoseOfTheOwner) {
  Start({.sessions = 1});
  const SentMesh mesh(1);
  v1::UploadMeshResponse uploaded;
  ASSERT_TRUE(SendMesh(*stubs_, ann_, mesh, &uploaded).status.ok());
  ASSERT_TRUE(SendMesh(*stubs_, bob_, mesh, &uploaded).status.ok());
  v1::Session first;
  v1::Session other;
  ASSERT_TRUE(CreateSession(ann_, mesh, &first).ok());
  ExpectRefused(CreateSession(ann_, mesh, &other), "sessions");
  EXPECT_TRUE(CreateSession(bob_, mesh, &other).ok());
  v1::DeleteSessionRequest request;
  request.set_name(first.name());
  google::protobuf::Empty nothing;
  ASSERT_TRUE(stubs_->sessions->DeleteSession(ContextOf(ann_).get(), request, &nothing).ok());
  EXPECT_TRUE(CreateSession(ann_, mesh, &first).ok());
}

TEST_F(QuotasTest, MeshesCasesAndPredictionsShareTheDisk) {
  const SentMesh mesh(1);
  const SentMesh second(2);
  Start({.disk_bytes = 60'000});
  v1::UploadMeshResponse uploaded;
  ASSERT_TRUE(SendMesh(*stubs_, ann_, mesh, &uploaded).status.ok());
  const int64_t mesh_bytes = uploaded.committed_bytes();
  v1::UploadCaseResponse case_response;
  const std::string rest(static_cast<size_t>(60'000 - mesh_bytes), 'c');
  ASSERT_TRUE(SendCase(*stubs_, ann_, rest, "", &case_response).status.ok()) << "to the last byte";
  ExpectRefused(SendCase(*stubs_, ann_, "one more", "", &case_response).status, "disk-mib");
  ExpectRefused(SendMesh(*stubs_, ann_, second, &uploaded).status, "disk-mib");
  EXPECT_TRUE(SendMesh(*stubs_, ann_, mesh, &uploaded).status.ok()) << "it is here";
  v1::Session session;
  ASSERT_TRUE(CreateSession(ann_, mesh, &session).ok());
  v1::CreatePredictionRequest prediction;
  prediction.set_session(session.name());
  *prediction.add_poses() = ToProto(TopPose(SomePose(1)).front());
  v1::Prediction predicted;
  ExpectRefused(
      stubs_->predictions->CreatePrediction(ContextOf(ann_).get(), prediction, &predicted),
      "disk-mib");
  EXPECT_TRUE(SendMesh(*stubs_, bob_, second, &uploaded).status.ok());

  v1::Usage usage;
  ASSERT_TRUE(stubs_->access->GetUsage(ContextOf(ann_).get(), {}, &usage).ok());
  ASSERT_EQ(usage.principals_size(), 1);
  EXPECT_EQ(usage.principals(0).disk_bytes(), 60'000);
}

TEST_F(QuotasTest, OnlyTheCallerAboveTheRateLimitIsRefused) {
  Start({.calls_per_second = 5});
  grpc::Status refused;
  for (int i = 0; i < 100 && refused.ok(); ++i) {
    v1::Caller caller;
    refused = stubs_->access->WhoAmI(ContextOf(ann_).get(), {}, &caller);
  }
  ExpectRefused(refused, "calls-per-second");
  v1::Caller caller;
  EXPECT_TRUE(stubs_->access->WhoAmI(ContextOf(bob_).get(), {}, &caller).ok());
}

TEST_F(QuotasTest, PosesOfADragDoNotCountAsCalls) {
  Start({.calls_per_second = 20, .streams = 1});
  const SentMesh mesh(1);
  v1::UploadMeshResponse uploaded;
  ASSERT_TRUE(SendMesh(*stubs_, ann_, mesh, &uploaded).status.ok());
  v1::Session session;
  ASSERT_TRUE(CreateSession(ann_, mesh, &session).ok());
  const auto context = ContextOf(ann_);
  const auto drag = stubs_->deform->Deform(context.get());
  v1::DeformRequest request;
  request.mutable_configuration()->set_session(session.name());
  ASSERT_TRUE(drag->Write(request));
  v1::DeformResponse response;
  ASSERT_TRUE(drag->Read(&response)) << "the stream that counts has begun";
  constexpr uint64_t kPoses = 500;
  for (uint64_t sequence = 1; sequence <= kPoses; ++sequence) {
    request.mutable_pose()->set_sequence(sequence);
    request.mutable_pose()->clear_poses();
    *request.mutable_pose()->add_poses() = ToProto(TopPose(SomePose(1)).front());
    ASSERT_TRUE(drag->Write(request));
  }
  const auto second_context = ContextOf(ann_);
  const auto second = stubs_->deform->Deform(second_context.get());
  ExpectRefused(second->Finish(), "streams");
  uint64_t newest = 0;
  uint64_t answered = 0;
  int64_t coalesced = 0;
  while (newest < kPoses && drag->Read(&response)) {
    if (!response.has_frame()) continue;
    newest = response.frame().sequence();
    coalesced += response.frame().coalesced_count();
    ++answered;
    request.mutable_ack()->set_sequence(newest);
    drag->Write(request);
  }
  EXPECT_EQ(newest, kPoses);
  EXPECT_EQ(answered + static_cast<uint64_t>(coalesced), kPoses) << "all are accounted for";
  drag->WritesDone();
  while (drag->Read(&response)) {
  }
  EXPECT_TRUE(drag->Finish().ok());
}

}  // namespace
}  // namespace tissueform::testing
