// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <future>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "spdlog/spdlog.h"

#include "core/mechanics/answer_evaluator/pose_range.h"
#include "core/mechanics/uncertainty/band_columns.h"
#include "proto/conversion/material_conversion.h"
#include "server/rpc/resource_conversion.h"
#include "tests/server/rpc/reactors_fixture.h"
#include "tests/testing/handle_problem.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

// The services without sockets: reactions come from a pool of threads that ThreadSanitizer sees
// through.
namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;

TEST_F(ReactorsTest, AStreamAnswersAndEnds) {
  FakeStream stream(reactions_.get());
  stream.Bind(deform_service_.Deform(nullptr));
  stream.Send(Configuration(MakeSession()));
  EXPECT_TRUE(stream.Receive()->has_started());
  for (uint64_t sequence = 1; sequence <= 20; ++sequence) {
    stream.Send(Pose(sequence));
    const auto response = stream.Receive();
    ASSERT_TRUE(response.has_value() && response->has_frame());
    EXPECT_EQ(response->frame().sequence(), sequence);
    ExpectAnswers(response->frame());
    stream.Send(Ack(sequence));
  }
  stream.CloseSending();
  EXPECT_FALSE(stream.Receive().has_value());
  EXPECT_TRUE(stream.WaitUntilDone()->ok());
  EXPECT_EQ(streams_.size(), 0);
}

TEST_F(ReactorsTest, AStreamGoesOnWhenItsSessionHadLeftMemory) {
  for (const bool prepared : {false, true}) {
    SCOPED_TRACE(prepared);
    FakeStream stream(reactions_.get());
    stream.Bind(deform_service_.Deform(nullptr));
    v1::DeformRequest configuration = Configuration(MakeSession());
    // Closer than ExpectAnswers looks.
    if (prepared) configuration.mutable_configuration()->mutable_prepared()->set_tolerance_mm(1e-5);
    stream.Send(configuration);
    EXPECT_TRUE(stream.Receive()->has_started());
    for (uint64_t sequence = 1; sequence <= 3; ++sequence) {
      stream.Send(Pose(sequence));
      if (sequence > 1) {
        EXPECT_TRUE(stream.Receive()->notice().has_evicted());
        EXPECT_TRUE(stream.Receive()->notice().has_restored());
      }
      const auto response = stream.Receive();
      ASSERT_TRUE(response.has_value() && response->has_frame());
      EXPECT_EQ(response->frame().sequence(), sequence);
      EXPECT_EQ(response->frame().summary().prepared(), prepared);
      ExpectAnswers(response->frame());
      stream.Send(Ack(sequence));
      clock_.Advance(2 * SessionTable::kInUse);
      EXPECT_EQ(registry_.table().Evict([] { return false; }), 1);
    }
    stream.CloseSending();
    EXPECT_FALSE(stream.Receive().has_value());
    EXPECT_TRUE(stream.WaitUntilDone()->ok());
  }
}

class FrameBandTest : public ReactorsTest {
 protected:
  // Tissues in layers along x, so that they share what the handle pulls.
  v1::DeformRequest WithRanges(v1::DeformationModel model) {
    for (Eigen::Index t = 0; t < sample_.mesh.num_tets(); ++t) {
      const double x = sample_.mesh.positions()(sample_.mesh.tets().row(t), 0).mean();
      ranges_.tissue_of_tet.push_back(x < 1 ? 0 : 1);
    }
    ranges_.tissues = {{"", 2}, {"", 3}};
    v1::DeformRequest request = Configuration(MakeSession());
    request.mutable_configuration()->set_model(model);
    *request.mutable_configuration()->mutable_prepared()->mutable_ranges() = ToProto(ranges_);
    return request;
  }

  MaterialUncertainty ranges_;
};

TEST_F(FrameBandTest, FramesContainTheBandOfTheirPose) {
  const v1::DeformRequest request = WithRanges(v1::DEFORMATION_MODEL_LINEAR_ELASTIC);
  FakeStream stream(reactions_.get());
  stream.Bind(deform_service_.Deform(nullptr));
  stream.Send(request);
  EXPECT_TRUE(stream.Receive()->has_started());
  const Eigen::Index vertices = sample_.mesh.num_vertices();
  ASSERT_OK_AND_ASSIGN(
      const auto preparation,
      MeshPreparation::Create(sample_.mesh, Eigen::VectorXd::Constant(sample_.mesh.num_tets(), 1e3),
                              BarEnds(sample_.mesh), {}));
  ASSERT_OK_AND_ASSIGN(
      const auto columns,
      BandColumns::Create(preparation, ranges_, testing::AllVertices(sample_.mesh), {}));
  for (const uint64_t sequence : {32, 64}) {
    stream.Send(Pose(sequence));
    const auto response = stream.Receive();
    ASSERT_TRUE(response.has_value() && response->has_frame());
    ASSERT_OK_AND_ASSIGN(const Eigen::VectorXf band,
                         FloatsFromBytes(response->frame().uncertainty_p95_mm(), vertices));
    HandlePose pose;
    pose.translation_mm.z() = static_cast<double>(sequence) / 64;
    Eigen::VectorXf expected;
    columns->Evaluate({pose}, kLargestBandRotationRad, &expected);
    EXPECT_GT(expected.maxCoeff(), 1e-3F);
    EXPECT_LT((band - expected).cwiseAbs().maxCoeff(), 1e-5F);
    stream.Send(Ack(sequence));
  }
  stream.CloseSending();
  EXPECT_FALSE(stream.Receive().has_value());
  EXPECT_TRUE(stream.WaitUntilDone()->ok());
}

TEST_F(FrameBandTest, RangesThatDoNotFitTheSessionAreRefused) {
  const auto refused = [&](const v1::DeformRequest& request, const char* why) {
    FakeStream stream(reactions_.get());
    stream.Bind(deform_service_.Deform(nullptr));
    stream.Send(request);
    const auto status = stream.WaitUntilDone();
    EXPECT_EQ(status->error_code(), grpc::StatusCode::INVALID_ARGUMENT);
    EXPECT_THAT(status->error_message(), HasSubstr(why));
  };
  v1::DeformRequest request = WithRanges(v1::DEFORMATION_MODEL_GRADIENT_FIELD);
  refused(request, "ranges need linear_elastic or neo_hookean");
  request.mutable_configuration()->mutable_prepared()->mutable_ranges()->set_tissues("?");
  refused(request, "ranges.tissues has 1 bytes");
}

TEST_F(ReactorsTest, CommitsAreAnsweredEachOrByANewerOne) {
  const std::string session = MakeSession();
  FakeStream stream(reactions_.get());
  stream.Bind(deform_service_.Deform(nullptr));
  stream.Send(Configuration(session));
  EXPECT_TRUE(stream.Receive()->has_started());
  constexpr uint64_t kLast = 20;
  for (uint64_t sequence = 1; sequence <= kLast; ++sequence) {
    v1::DeformRequest pose = Pose(sequence);
    pose.mutable_pose()->set_commit(true);
    stream.Send(pose);
  }
  stream.CloseSending();
  uint64_t committed = 0;
  while (const auto response = stream.Receive()) {
    if (!response->has_notice()) continue;
    EXPECT_GT(response->notice().committed().sequence(), committed);
    EXPECT_EQ(response->notice().committed().failure(), "");
    committed = response->notice().committed().sequence();
  }
  EXPECT_TRUE(stream.WaitUntilDone()->ok());
  EXPECT_EQ(committed, kLast) << "also the last one, whose client had closed its side";
  v1::Session description;
  registry_.sync().Look(session.substr(session.find('/') + 1),
                        [&description](const absl::StatusOr<SessionView>& view) {
                          ASSERT_THAT(view, IsOk());
                          description = ToProto(*view);
                        });
  ASSERT_EQ(description.committed_poses_size(), 1);
  EXPECT_EQ(description.committed_poses(0).translation_mm().z(), kLast / 64.0);
}

TEST_F(ReactorsTest, StreamsSurviveWhateverTheClientDoes) {
  const std::string session = MakeSession();
  for (uint32_t seed = 1; seed <= 60; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    FakeStream stream(reactions_.get());
    stream.Bind(deform_service_.Deform(nullptr));
    stream.Send(Configuration(session));
    ASSERT_TRUE(stream.Receive().has_value());
    bool cancelled = false;
    uint64_t last = 0;
    for (int step = 0; step < 40 && !cancelled; ++step) {
      switch (random() % 16) {
        case 0:
          cancelled = random() % 4 == 0;
          break;
        case 2:
          clock_.Advance(2 * SessionTable::kInUse);
          registry_.table().Evict([] { return false; });
          break;
        case 1:
          streams_.NotifyDraining(std::chrono::system_clock::now());
          break;
        default:
          stream.Send(Pose(++last));
      }
    }
    if (cancelled) {
      stream.Cancel();
    } else {
      stream.CloseSending();
    }
    int64_t accounted = 0;
    while (const auto response = stream.Receive()) {
      if (response->has_frame()) {
        accounted += 1 + response->frame().coalesced_count();
        ExpectAnswers(response->frame());
      }
    }
    const auto status = stream.WaitUntilDone();
    ASSERT_TRUE(status.has_value()) << "the stream does not end";
    EXPECT_EQ(status->ok(), !cancelled);
    if (!cancelled) {
      EXPECT_EQ(accounted, static_cast<int64_t>(last));
    }
  }
  EXPECT_EQ(streams_.size(), 0);
}

TEST_F(ReactorsTest, AClientThatDoesNotReadGetsOneWriteAndOthersGoOn) {
  const std::string session = MakeSession();
  FakeStream stuck(reactions_.get());
  stuck.Bind(deform_service_.Deform(nullptr));
  stuck.Send(Configuration(session));
  ASSERT_TRUE(stuck.Receive().has_value());
  stuck.StopReading();
  for (uint64_t sequence = 1; sequence <= 50; ++sequence) {
    stuck.Send(Pose(sequence));
  }
  FakeStream other(reactions_.get());
  other.Bind(deform_service_.Deform(nullptr));
  other.Send(Configuration(session));
  ASSERT_TRUE(other.Receive().has_value());
  other.Send(Pose(1));
  ASSERT_TRUE(other.Receive().has_value());
  other.CloseSending();
  EXPECT_TRUE(other.WaitUntilDone()->ok());
  EXPECT_LE(stuck.writes_started(), 2) << "`started` and one frame";
  stuck.Cancel();
  EXPECT_EQ(stuck.WaitUntilDone()->error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_EQ(streams_.size(), 0);
}

TEST_F(ReactorsTest, ServesUpToTheStreamLimitOfTenThousandStreams) {
  const auto level = spdlog::get_level();
  spdlog::set_level(spdlog::level::off);  // one line for each that is refused
  const std::string session = MakeSession();
  ServiceLimits patient = limits_;
  patient.configuration_deadline = std::chrono::minutes(10);
  DeformService service(&gate_, patient, &no_logins_.access, &registry_, &streams_, &watches_,
                        &timer_);
  const auto places = static_cast<size_t>(limits_.max_streams);
  std::vector<std::unique_ptr<FakeStream>> streams;
  for (int i = 0; i < 10'000; ++i) {
    streams.push_back(std::make_unique<FakeStream>(reactions_.get()));
    streams.back()->Bind(service.Deform(nullptr));
  }
  EXPECT_EQ(streams_.size(), limits_.max_streams);
  for (size_t i = places; i < streams.size(); ++i) {
    const auto status = streams[i]->WaitUntilDone();
    ASSERT_TRUE(status.has_value());
    ASSERT_EQ(status->error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
    ASSERT_NE(status->error_details().find("TOO_MANY_STREAMS"), std::string::npos);
  }
  spdlog::set_level(level);
  for (size_t i = 0; i < places; ++i) {
    streams[i]->Send(Configuration(session));
    EXPECT_TRUE(streams[i]->Receive()->has_started());
    streams[i]->Send(Pose(1));
    EXPECT_TRUE(streams[i]->Receive()->has_frame());
    streams[i]->CloseSending();
    EXPECT_TRUE(streams[i]->WaitUntilDone()->ok());
  }
  EXPECT_EQ(streams_.size(), 0);
}

TEST_F(ReactorsTest, EndsAStreamWithoutConfigurationAndFreesItsPlace) {
  ServiceLimits impatient = limits_;
  impatient.configuration_deadline = std::chrono::milliseconds(20);
  DeformService service(&gate_, impatient, &no_logins_.access, &registry_, &streams_, &watches_,
                        &timer_);
  FakeStream silent(reactions_.get());
  silent.Bind(service.Deform(nullptr));
  const auto status = silent.WaitUntilDone();
  ASSERT_TRUE(status.has_value()) << "it waits for ever";
  EXPECT_EQ(status->error_code(), grpc::StatusCode::DEADLINE_EXCEEDED);
  EXPECT_NE(status->error_message().find("configuration"), std::string::npos);
  EXPECT_EQ(streams_.size(), 0);
}

TEST_F(ReactorsTest, AConfiguredStreamMayRest) {
  ServiceLimits impatient = limits_;
  impatient.configuration_deadline = std::chrono::milliseconds(200);
  DeformService service(&gate_, impatient, &no_logins_.access, &registry_, &streams_, &watches_,
                        &timer_);
  FakeStream stream(reactions_.get());
  stream.Bind(service.Deform(nullptr));
  stream.Send(Configuration(MakeSession()));
  ASSERT_TRUE(stream.Receive()->has_started());
  // Deadlines pass in their order: once this one has, the stream's has.
  std::promise<void> passed;
  timer_.Start(std::chrono::steady_clock::now() + impatient.configuration_deadline,
               [&passed] { passed.set_value(); });
  passed.get_future().wait();
  stream.Send(Pose(1));
  EXPECT_TRUE(stream.Receive()->has_frame());
  stream.CloseSending();
  EXPECT_TRUE(stream.WaitUntilDone()->ok());
}

TEST_F(ReactorsTest, OnlyTheSessionsThatWereNotCancelledStay) {
  constexpr int kCalls = 24;
  const v1::CreateSessionRequest request = SessionRequestOf(*Store(sample_, &catalog_));
  std::vector<v1::Session> sessions(kCalls);
  std::vector<std::unique_ptr<FakeUnaryCall>> calls;
  for (int i = 0; i < kCalls; ++i) {
    calls.push_back(std::make_unique<FakeUnaryCall>(reactions_.get()));
    BindCreateSession(calls[i].get(), request, &sessions[i]);
    if (i % 3 == 0) {
      calls[i]->Cancel();
    }
  }
  for (int i = 0; i < kCalls; ++i) {
    const auto status = calls[i]->WaitUntilDone();
    ASSERT_TRUE(status.has_value());
    if (i % 3 != 0) {
      EXPECT_TRUE(status->ok()) << status->error_message();
    }
  }
  // A cancelled call that ended before it heard of its cancellation was like any other.
  const int expected = kCalls - kCalls / 3;
  EXPECT_GE(registry_.table().size(), expected);
  for (const v1::Session& session : sessions) {
    const auto id = ParseSessionName(session.name());
    if (id.ok() && registry_.table().Find(*id).ok()) {
      std::promise<absl::Status> deleted;
      registry_.sync().Delete(
          *id, [&deleted](absl::Status status) { deleted.set_value(std::move(status)); });
      EXPECT_TRUE(deleted.get_future().get().ok());
    }
  }
  EXPECT_EQ(registry_.table().size(), 0) << "a session that nobody knows of";
}

}  // namespace
}  // namespace tissueform::testing
