// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// PrepareSession, and the end of cancelled calls (server/rpc/session_preparation.h).

#include <atomic>
#include <chrono>
#include <future>
#include <latch>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "server/rpc/resource_conversion.h"
#include "tests/server/rpc/reactors_fixture.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::IsSubsetOf;

using PrepareCall = FakeWriterCall<v1::PrepareSessionResponse>;

constexpr v1::PreparationStage kWaiting = v1::PREPARATION_STAGE_WAITING;
constexpr v1::PreparationStage kAssembling = v1::PREPARATION_STAGE_ASSEMBLING;
constexpr v1::PreparationStage kOrdering = v1::PREPARATION_STAGE_ORDERING;
constexpr v1::PreparationStage kFactorising = v1::PREPARATION_STAGE_FACTORISING;
constexpr v1::PreparationStage kResponses = v1::PREPARATION_STAGE_RESPONSES;
constexpr v1::PreparationStage kKeeping = v1::PREPARATION_STAGE_KEEPING;
constexpr v1::PreparationStage kAnswers = v1::PREPARATION_STAGE_ANSWERS;

// What a call said until its end.
struct Outcome {
  std::vector<v1::PreparationStage> stages;
  std::vector<v1::PreparationProgress> progress;
  std::optional<v1::Session> session;
  grpc::Status status;
};

class PrepareSessionTest : public ReactorsTest {
 protected:
  v1::PrepareSessionRequest Creation(
      v1::DeformationModel model = v1::DEFORMATION_MODEL_LINEAR_ELASTIC) {
    const std::shared_ptr<const StoredMesh> mesh = Store(sample_, &catalog_);
    mesh_bytes_ = mesh->reservation.bytes();
    v1::PrepareSessionRequest request;
    *request.mutable_create() = SessionRequestOf(*mesh);
    request.mutable_create()->set_model(model);
    return request;
  }

  std::unique_ptr<PrepareCall> Call(const v1::PrepareSessionRequest& request) {
    auto call = std::make_unique<PrepareCall>(reactions_.get());
    call->Bind(session_service_.PrepareSession(nullptr, &request));
    return call;
  }

  // Reads to the end.
  static Outcome EndOf(PrepareCall* call) {
    Outcome outcome;
    while (const auto response = call->Receive()) {
      EXPECT_FALSE(outcome.session.has_value()) << "it is the last message";
      if (response->has_session()) outcome.session = response->session();
      if (!response->has_progress()) continue;
      const v1::PreparationProgress& progress = response->progress();
      EXPECT_LE(progress.step(), progress.steps());
      if (!outcome.progress.empty()) {
        const v1::PreparationProgress& before = outcome.progress.back();
        EXPECT_GE(progress.stage(), before.stage());
        EXPECT_GE(progress.elapsed_seconds(), before.elapsed_seconds());
        if (progress.stage() == before.stage()) {
          EXPECT_GT(progress.step(), before.step());
        }
      }
      outcome.stages.push_back(progress.stage());
      outcome.progress.push_back(progress);
    }
    const std::optional<grpc::Status> status = call->WaitUntilDone();
    EXPECT_TRUE(status.has_value()) << "the call does not end";
    outcome.status = status.value_or(grpc::Status::CANCELLED);
    return outcome;
  }

  Outcome Run(const v1::PrepareSessionRequest& request) { return EndOf(Call(request).get()); }

  // Runs what is queued at the moment: all workers of a lane meet.
  void Drain() {
    for (const Lane lane : {Lane::kStore, Lane::kBatch, Lane::kSolves}) {
      const auto all = std::make_shared<std::latch>(kWorkers + 1);
      for (int worker = 0; worker < kWorkers; ++worker) {
        workers_->Post(lane, [all] { all->arrive_and_wait(); });
      }
      all->arrive_and_wait();
    }
  }

  // Nothing runs in the lane until the result is set.
  std::promise<void> Hold(Lane lane) {
    std::promise<void> go;
    const std::shared_future<void> may_go = go.get_future().share();
    for (int worker = 0; worker < kWorkers; ++worker) {
      workers_->Post(lane, [may_go] { may_go.wait(); });
    }
    return go;
  }

  void Evict() {
    Drain();
    clock_.Advance(2 * SessionTable::kInUse);
    registry_.table().Evict([] { return false; });
  }

  std::string EtagOf(const std::string& session) {
    std::string etag;
    registry_.sync().Look(session.substr(session.find('/') + 1),
                          [&etag](const absl::StatusOr<SessionView>& view) {
                            if (view.ok()) etag = view->record.etag;
                          });
    return etag;
  }

  int64_t mesh_bytes_ = 0;
};

TEST_F(PrepareSessionTest, ACreationReportsItsStagesInOrderThenTheSession) {
  const Outcome outcome = Run(Creation());
  EXPECT_TRUE(outcome.status.ok()) << outcome.status.error_message();
  // What comes while a message is written gives way to what is newer.
  EXPECT_EQ(outcome.stages.front(), kWaiting);
  EXPECT_THAT(outcome.stages,
              IsSubsetOf({kWaiting, kAssembling, kOrdering, kFactorising, kResponses, kKeeping}));
  ASSERT_TRUE(outcome.session.has_value());
  EXPECT_EQ(outcome.session->state(), v1::SESSION_STATE_READY);
  EXPECT_FALSE(outcome.session->etag().empty());
  EXPECT_EQ(registry_.table().size(), 1);
}

TEST_F(PrepareSessionTest, AReadySessionIsAnsweredAtOnce) {
  const std::string session = MakeSession();
  v1::PrepareSessionRequest request;
  request.set_open(session);
  const Outcome outcome = Run(request);
  EXPECT_THAT(outcome.stages, IsEmpty());
  ASSERT_TRUE(outcome.session.has_value());
  EXPECT_EQ(outcome.session->name(), session);
}

TEST_F(PrepareSessionTest, ASessionThatHadLeftMemoryComesBackAndSoDoesOneThatIsUpdated) {
  const std::string session = MakeSession();
  const std::string etag = EtagOf(session);
  Evict();
  ASSERT_EQ(registry_.table().size(), 0);
  v1::PrepareSessionRequest request;
  request.set_open(session);
  const std::vector<v1::PreparationStage> making = {v1::PREPARATION_STAGE_READING_MESH,
                                                    kWaiting,
                                                    kAssembling,
                                                    kOrdering,
                                                    kFactorising,
                                                    kResponses};
  Outcome outcome = Run(request);
  EXPECT_EQ(outcome.stages.front(), v1::PREPARATION_STAGE_READING_MESH);
  EXPECT_THAT(outcome.stages, IsSubsetOf(making));
  EXPECT_EQ(registry_.table().size(), 1);
  EXPECT_EQ(outcome.session->etag(), etag);
  request.mutable_update()->set_name(session);
  request.mutable_update()->mutable_stiffness()->set_uniform_pa(500);
  outcome = Run(request);
  std::vector<v1::PreparationStage> kept = making;
  kept.push_back(kKeeping);
  EXPECT_EQ(outcome.stages.front(), v1::PREPARATION_STAGE_READING_MESH);
  EXPECT_THAT(outcome.stages, IsSubsetOf(kept));
  ASSERT_TRUE(outcome.session.has_value());
  EXPECT_EQ(outcome.session->name(), session);
  EXPECT_NE(outcome.session->etag(), etag);
}

TEST_F(PrepareSessionTest, AnswersOfTheStreamThatIsToComeAreMadeAndCounted) {
  v1::PrepareSessionRequest request = Creation(v1::DEFORMATION_MODEL_GRADIENT_FIELD);
  request.mutable_stream()->mutable_prepared();
  request.mutable_stream()->mutable_vertices()->mutable_skin();
  const Outcome outcome = Run(request);
  ASSERT_TRUE(outcome.session.has_value()) << outcome.status.error_message();
  EXPECT_THAT(outcome.stages, IsSubsetOf({kWaiting, kAssembling, kOrdering, kFactorising,
                                          kResponses, kKeeping, kAnswers}));
  // A stream that asks for the same takes no more memory.
  const int64_t bytes = budget_.reserved_bytes();
  FakeStream stream(reactions_.get());
  stream.Bind(deform_service_.Deform(nullptr));
  v1::DeformRequest configuration;
  *configuration.mutable_configuration() = request.stream();
  configuration.mutable_configuration()->set_session(outcome.session->name());
  stream.Send(configuration);
  const auto started = stream.Receive();
  EXPECT_GT(started->started().prepared_terms(), 0);
  EXPECT_EQ(budget_.reserved_bytes(), bytes);
  stream.CloseSending();
  EXPECT_TRUE(stream.WaitUntilDone()->ok());
}

TEST_F(PrepareSessionTest, AnswersThatCannotBeMadeLeaveNoSession) {
  v1::PrepareSessionRequest request = Creation(v1::DEFORMATION_MODEL_ARAP);
  request.mutable_stream()->mutable_prepared();
  const Outcome outcome = Run(request);
  EXPECT_EQ(outcome.status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_THAT(outcome.status.error_message(), HasSubstr("prepared answers"));
  Drain();
  EXPECT_EQ(registry_.table().size(), 0);
  EXPECT_EQ(budget_.reserved_bytes(), mesh_bytes_);
}

TEST_F(PrepareSessionTest, ErrorsAreThoseOfTheUnaryCalls) {
  v1::PrepareSessionRequest request = Creation();
  request.mutable_create()->mutable_stiffness()->set_uniform_pa(-1);
  v1::PrepareSessionRequest update;
  update.mutable_update()->set_name(MakeSession());
  update.mutable_update()->set_etag("of another time");
  update.mutable_update()->mutable_stiffness()->set_uniform_pa(2);
  v1::PrepareSessionRequest missing = request;
  missing.mutable_create()->set_mesh("meshes/" + std::string(64, '0'));
  v1::PrepareSessionRequest nameless;
  nameless.mutable_update();
  for (const v1::PrepareSessionRequest& wrong : {request, update, missing, nameless}) {
    SCOPED_TRACE(wrong.ShortDebugString());
    FakeUnaryCall unary(reactions_.get());
    v1::Session session;
    unary.Bind(wrong.has_create()
                   ? session_service_.CreateSession(nullptr, &wrong.create(), &session)
                   : session_service_.UpdateSession(nullptr, &wrong.update(), &session));
    const std::optional<grpc::Status> expected = unary.WaitUntilDone();
    const Outcome outcome = Run(wrong);
    ASSERT_FALSE(expected->ok());
    EXPECT_EQ(outcome.status.error_code(), expected->error_code());
    EXPECT_EQ(outcome.status.error_message(), expected->error_message());
    EXPECT_EQ(outcome.status.error_details(), expected->error_details());
    EXPECT_FALSE(outcome.session.has_value());
  }
  v1::PrepareSessionRequest gone;
  gone.set_open("sessions/none");
  EXPECT_EQ(Run(gone).status.error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(Run({}).status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  gate_.StartDraining();
  EXPECT_EQ(Run(Creation()).status.error_code(), grpc::StatusCode::UNAVAILABLE);
}

TEST_F(PrepareSessionTest, CancelledInAnyStageItIsAnsweredAtOnceAndLeavesNothing) {
  v1::PrepareSessionRequest request = Creation();
  request.mutable_create()->set_request_id("id");
  const std::shared_ptr<const StoredMesh> mesh = Store(sample_, &catalog_);
  for (const SessionStage stage :
       {SessionStage::kWaiting, SessionStage::kAssembling, SessionStage::kOrdering,
        SessionStage::kFactorising, SessionStage::kResponses, SessionStage::kKeeping}) {
    SCOPED_TRACE(static_cast<int>(stage));
    // Another call of the same request holds the worker in that stage.
    absl::StatusOr<SessionRecord> record =
        ToSessionRecord(request.create(), *mesh, Principal(), limits_);
    ASSERT_THAT(record, IsOk());
    std::promise<void> reached;
    std::promise<void> go;
    const std::shared_future<void> may_go = go.get_future().share();
    const auto cancelled = std::make_shared<std::atomic<bool>>(false);
    bool held = false;
    std::thread blocking([&] {
      registry_.loader().Create(
          *record, mesh, cancelled, [](const absl::StatusOr<std::shared_ptr<Session>>&) {},
          [&](const SessionProgress& progress) {
            if (progress.stage != stage || std::exchange(held, true)) return;
            reached.set_value();
            may_go.wait();
          });
    });
    reached.get_future().wait();
    const std::unique_ptr<PrepareCall> call = Call(request);
    ASSERT_TRUE(call->Receive()->has_progress()) << "it has joined";
    call->Cancel();
    EXPECT_EQ(EndOf(call.get()).status.error_code(), grpc::StatusCode::CANCELLED);
    EXPECT_TRUE(gate_.WaitUntilIdle(std::chrono::steady_clock::now()));
    *cancelled = true;
    registry_.loader().CancelWait(cancelled);
    go.set_value();
    blocking.join();
    Drain();
    Drain();
    EXPECT_EQ(registry_.table().size(), 0);
    EXPECT_EQ(budget_.reserved_bytes(), mesh_bytes_);
  }
}

TEST_F(PrepareSessionTest, ACancelledUpdateIsAnsweredAtOnceAndTheSessionIsAsItWas) {
  const std::string session = MakeSession();
  const std::string etag = EtagOf(session);
  const int64_t bytes = budget_.reserved_bytes();
  v1::PrepareSessionRequest request;
  request.mutable_update()->set_name(session);
  request.mutable_update()->mutable_stiffness()->set_uniform_pa(500);
  for (const bool unary : {false, true}) {
    SCOPED_TRACE(unary);
    std::promise<void> go = Hold(Lane::kBatch);
    if (unary) {
      v1::Session response;
      FakeUnaryCall call(reactions_.get());
      call.Bind(session_service_.UpdateSession(nullptr, &request.update(), &response));
      call.Cancel();
      EXPECT_EQ(call.WaitUntilDone()->error_code(), grpc::StatusCode::CANCELLED);
    } else {
      const std::unique_ptr<PrepareCall> call = Call(request);
      ASSERT_TRUE(call->Receive()->has_progress());
      call->Cancel();
      EXPECT_EQ(EndOf(call.get()).status.error_code(), grpc::StatusCode::CANCELLED);
    }
    go.set_value();
    Drain();
    EXPECT_EQ(EtagOf(session), etag);
    EXPECT_EQ(budget_.reserved_bytes(), bytes);
  }
}

TEST_F(PrepareSessionTest, ARestoreThatIsCancelledWhileItReadsIsAnsweredAtOnce) {
  const std::string session = MakeSession();
  Evict();
  std::promise<void> go = Hold(Lane::kStore);
  v1::PrepareSessionRequest request;
  request.set_open(session);
  const std::unique_ptr<PrepareCall> call = Call(request);
  EXPECT_EQ(call->Receive()->progress().stage(), v1::PREPARATION_STAGE_READING_MESH);
  call->Cancel();
  EXPECT_EQ(EndOf(call.get()).status.error_code(), grpc::StatusCode::CANCELLED);
  go.set_value();
  Drain();
  EXPECT_EQ(registry_.table().size(), 0);
  EXPECT_TRUE(Run(request).session.has_value());
}

TEST_F(PrepareSessionTest, TwoCallsOfOneRequestShareProgressAndSession) {
  std::promise<void> go = Hold(Lane::kBatch);
  v1::PrepareSessionRequest request = Creation();
  request.mutable_create()->set_request_id("id");
  const std::unique_ptr<PrepareCall> one = Call(request);
  ASSERT_EQ(one->Receive()->progress().stage(), kWaiting);
  const std::unique_ptr<PrepareCall> two = Call(request);
  ASSERT_EQ(two->Receive()->progress().stage(), kWaiting);
  go.set_value();
  const Outcome first = EndOf(one.get());
  const Outcome second = EndOf(two.get());
  // Both have seen it wait; what came after that may have been overtaken by the end.
  for (const Outcome* outcome : {&first, &second}) {
    EXPECT_THAT(outcome->stages,
                IsSubsetOf({kAssembling, kOrdering, kFactorising, kResponses, kKeeping}));
  }
  ASSERT_TRUE(first.session.has_value() && second.session.has_value());
  EXPECT_EQ(first.session->name(), second.session->name());
  EXPECT_EQ(registry_.table().size(), 1);
}

TEST_F(PrepareSessionTest, ASlowReaderDelaysNothingAndReceivesTheNewest) {
  const std::unique_ptr<PrepareCall> call = std::make_unique<PrepareCall>(reactions_.get());
  call->StopReading();
  const v1::PrepareSessionRequest request = Creation();
  call->Bind(session_service_.PrepareSession(nullptr, &request));
  // Made while nothing is read.
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (registry_.table().size() == 0 && std::chrono::steady_clock::now() < deadline) Drain();
  ASSERT_EQ(registry_.table().size(), 1);
  Drain();
  call->ReadOn();
  const Outcome outcome = EndOf(call.get());
  EXPECT_THAT(outcome.stages, ElementsAre(kWaiting)) << "the write that was stuck; then the end";
  ASSERT_TRUE(outcome.session.has_value());
}

TEST_F(PrepareSessionTest, OnlyTheSessionsThatWereNotCancelledStay) {
  constexpr int kCalls = 24;
  std::vector<std::unique_ptr<PrepareCall>> calls;
  std::vector<v1::PrepareSessionRequest> requests(kCalls, Creation());
  for (int i = 0; i < kCalls; ++i) {
    requests[i].mutable_create()->mutable_stiffness()->set_uniform_pa(100 + i % 5);
    calls.push_back(Call(requests[i]));
    if (i % 3 == 0) calls[i]->Cancel();
  }
  for (int i = 0; i < kCalls; ++i) {
    const Outcome outcome = EndOf(calls[i].get());
    EXPECT_TRUE(i % 3 == 0 || outcome.session.has_value()) << outcome.status.error_message();
    if (!outcome.session.has_value()) continue;
    // A cancelled call that ended before it heard of its cancellation was like any other.
    const std::string id = *ParseSessionName(outcome.session->name());
    if (!registry_.table().Find(id).ok()) continue;
    std::promise<absl::Status> deleted;
    registry_.sync().Delete(
        id, [&deleted](absl::Status status) { deleted.set_value(std::move(status)); });
    EXPECT_TRUE(deleted.get_future().get().ok());
  }
  Drain();
  Drain();
  EXPECT_EQ(registry_.table().size(), 0) << "a session that nobody knows of";
  EXPECT_EQ(budget_.reserved_bytes(), mesh_bytes_);
}

}  // namespace
}  // namespace tissueform::testing
