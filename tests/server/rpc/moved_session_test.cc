// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <atomic>
#include <chrono>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "gtest/gtest.h"

#include "tests/server/rpc/reactors_fixture.h"
#include "tests/server/rpc/watch_call.h"
#include "tests/testing/shared_sessions.h"
#include "tests/testing/status_matchers.h"

// Streams of a server whose sessions are taken over by another.
namespace tissueform::testing {
namespace {

struct SharedStore {
  SharedSessions shared_;
  FakeOwnership here_{&shared_, "here"};
  SharedSessionStore shared_store_{&shared_, "here"};
  FakeOwnership there_{&shared_, "there"};
};

bool HasMoved(const std::optional<grpc::Status>& status) {
  return status.has_value() && status->error_code() == grpc::StatusCode::UNAVAILABLE &&
         status->error_details().find("SESSION_MOVED") != std::string::npos;
}

class MovedSessionTest : protected SharedStore, public ReactorsTest {
 protected:
  MovedSessionTest() : ReactorsTest(&shared_store_, &here_) {
    registry_.table().set_observer([this](const std::string& id, SessionEvent event) {
      streams_.OnSessionEvent(id, event);
      watches_.OnSessionEvent(id, event);
    });
  }

  std::unique_ptr<FakeStream> Drag(const v1::DeformRequest& configuration) {
    auto stream = std::make_unique<FakeStream>(reactions_.get());
    stream->Bind(deform_service_.Deform(nullptr));
    stream->Send(configuration);
    EXPECT_TRUE(stream->Receive()->has_started());
    return stream;
  }
  std::unique_ptr<FakeStream> Drag(const std::string& session) {
    return Drag(Configuration(session));
  }
  static void Move(FakeStream* stream, uint64_t sequence) {
    stream->Send(Pose(sequence));
    while (const auto response = stream->Receive()) {
      if (response->has_frame()) break;
    }
    stream->Send(Ack(sequence));
  }
  static std::string IdOf(const std::string& session) { return *ParseSessionName(session); }

  void LetLeasesRunOut() { shared_.Wait(SharedSessions::kLeaseSeconds + 1); }
  // What the other server does, and what this one then hears.
  void TakeOver(const std::string& session) {
    LetLeasesRunOut();
    EXPECT_THAT(there_.Acquire(IdOf(session)), IsOk());
  }
  void ReportLost() {
    for (const std::string& id : here_.Renew()) registry_.Lost(id);
  }
};

TEST_F(MovedSessionTest, AStreamThatRestsEndsWhenItsSessionIsLost) {
  const std::string session = MakeSession();
  const std::string other = MakeSession();
  const auto stream = Drag(session);
  const auto other_stream = Drag(other);
  Move(stream.get(), 1);
  TakeOver(session);
  registry_.Lost(IdOf(session));
  EXPECT_TRUE(HasMoved(stream->WaitUntilDone()));
  EXPECT_EQ(streams_.size(), 1) << "nothing was said of the other session";
  registry_.Lost(IdOf(other));
  EXPECT_TRUE(HasMoved(other_stream->WaitUntilDone()));
}

TEST_F(MovedSessionTest, AnswersNoPoseAfterItsLeaseEvenWithoutANotice) {
  for (const bool prepared : {false, true}) {
    SCOPED_TRACE(prepared);
    v1::DeformRequest configuration = Configuration(MakeSession());
    if (prepared) configuration.mutable_configuration()->mutable_prepared()->set_tolerance_mm(1e-5);
    const auto stream = Drag(configuration);
    Move(stream.get(), 1);
    LetLeasesRunOut();
    stream->Send(Pose(2));
    EXPECT_FALSE(stream->Receive().has_value());
    EXPECT_TRUE(HasMoved(stream->WaitUntilDone()));
  }
}

TEST_F(MovedSessionTest, AFrameThatWaitsForItsWriteIsNotWritten) {
  const auto stream = Drag(MakeSession());
  stream->StopReading();
  stream->Send(Pose(1));
  while (stream->writes_started() < 2) std::this_thread::yield();
  stream->Send(Pose(2));
  // It is made while the first is being written.
  std::promise<void> made;
  registry_.table().Loaded()[0]->strand().Post(Lane::kSolves, [&made] { made.set_value(); });
  made.get_future().wait();
  LetLeasesRunOut();
  stream->ReadOn();
  EXPECT_EQ(stream->Receive()->frame().sequence(), 1);
  EXPECT_FALSE(stream->Receive().has_value());
  EXPECT_TRUE(HasMoved(stream->WaitUntilDone()));
}

// The lease ends at every place that asks for it, early answers and a refinement among them.
TEST_F(MovedSessionTest, WritesNothingOnceTheSessionIsFoundLost) {
  const std::string session = MakeSession();
  int most_frames = 0;
  for (int answers = 0; answers < 40; ++answers) {
    SCOPED_TRACE(answers);
    v1::DeformRequest configuration = Configuration(session);
    configuration.mutable_configuration()->set_model(v1::DEFORMATION_MODEL_NEO_HOOKEAN);
    configuration.mutable_configuration()->set_max_unacked(8);
    if (answers % 2 == 0) configuration.mutable_configuration()->mutable_prepared();
    here_.set_answers_left(-1, nullptr);
    const auto stream = Drag(configuration);
    std::atomic<int> written = -1;
    here_.set_answers_left(answers, [&] { written = stream->writes_started(); });
    for (uint64_t sequence = 1; sequence <= 3; ++sequence) stream->Send(Pose(64 * sequence));
    stream->CloseSending();
    int frames = 0;
    while (const auto response = stream->Receive()) frames += response->has_frame() ? 1 : 0;
    const auto status = stream->WaitUntilDone();
    most_frames = std::max(most_frames, frames);
    if (written < 0) {
      EXPECT_TRUE(status->ok()) << "it was never asked that often";
    } else {
      EXPECT_TRUE(HasMoved(status));
      EXPECT_EQ(frames + 1, written) << "and `started`";
    }
    here_.set_answers_left(-1, nullptr);
  }
  EXPECT_GT(most_frames, 1);
}

TEST_F(MovedSessionTest, ACommitUnderAnOldEpochEndsTheStreamAndIsNotKept) {
  const std::string session = MakeSession();
  const auto stream = Drag(session);
  Move(stream.get(), 1);
  // Stopped before the other takes it, and goes on where it was: in between the stream could see
  // that it has moved, and end before it commits.
  here_.set_stopped(true);
  TakeOver(session);
  v1::DeformRequest pose = Pose(2);
  pose.mutable_pose()->set_commit(true);
  stream->Send(pose);
  while (const auto response = stream->Receive()) EXPECT_FALSE(response->notice().has_committed());
  EXPECT_TRUE(HasMoved(stream->WaitUntilDone()));
  EXPECT_EQ(shared_.refused_writes(), 1);
  EXPECT_EQ(shared_.stale_writes(), 0);
}

TEST_F(MovedSessionTest, AStreamDoesNotWaitForACommitThatTheStoreNeverAnswers) {
  const std::string session = MakeSession();
  auto stream = Drag(session);
  shared_store_.FallSilent();
  v1::DeformRequest pose = Pose(1);
  pose.mutable_pose()->set_commit(true);
  stream->Send(pose);
  EXPECT_TRUE(stream->Receive()->has_frame());
  const SessionStore::StatusCallback answer = shared_store_.WaitForUnanswered();
  LetLeasesRunOut();
  ReportLost();
  EXPECT_TRUE(HasMoved(stream->WaitUntilDone()));
  stream.reset();
  answer(absl::OkStatus());  // finds no stream
}

TEST_F(MovedSessionTest, CallsOfAnEvictedSessionReportWhichNodeHasIt) {
  const std::string session = MakeSession();
  const auto stream = Drag(session);
  clock_.Advance(2 * SessionTable::kInUse);
  EXPECT_EQ(registry_.table().Evict([] { return false; }), 1);
  FakeUnaryCall once(reactions_.get());
  v1::DeformOnceRequest request;
  request.set_session(session);
  *request.add_poses() = Pose(1).pose().poses(0);
  v1::DeformOnceResponse response;
  TakeOver(session);
  once.Bind(deform_service_.DeformOnce(nullptr, &request, &response));
  const auto status = once.WaitUntilDone();
  EXPECT_TRUE(HasMoved(status));
  EXPECT_NE(status->error_details().find("there"), std::string::npos);
  stream->Send(Pose(1));
  EXPECT_TRUE(HasMoved(stream->WaitUntilDone()));
}

TEST_F(MovedSessionTest, AStreamThatWaitsForItsSessionToBeMadeEndsAtOnce) {
  const std::string session = MakeSession();
  const auto stream = Drag(session);
  clock_.Advance(2 * SessionTable::kInUse);
  EXPECT_EQ(registry_.table().Evict([] { return false; }), 1);
  std::promise<void> release;
  const std::shared_future<void> released = release.get_future().share();
  for (int worker = 0; worker < kWorkers; ++worker) {
    workers_->Post(Lane::kBatch, [released] { released.wait(); });
  }
  std::promise<void> acquired;
  here_.set_acquired([&acquired] { acquired.set_value(); });
  stream->Send(Pose(1));
  acquired.get_future().wait();
  here_.set_acquired(nullptr);
  TakeOver(session);
  ReportLost();
  EXPECT_TRUE(HasMoved(stream->WaitUntilDone()));
  release.set_value();
}

TEST_F(MovedSessionTest, AnAnswerThatIsReadyTooLateIsNotGiven) {
  const std::string session = MakeSession();
  v1::DeformOnceRequest request;
  request.set_session(session);
  *request.add_poses() = Pose(1).pose().poses(0);
  bool was_given = false;
  bool was_refused = false;
  for (int answers = 0; answers < 6; ++answers) {
    here_.set_answers_left(answers, nullptr);
    FakeUnaryCall once(reactions_.get());
    v1::DeformOnceResponse response;
    once.Bind(deform_service_.DeformOnce(nullptr, &request, &response));
    const auto status = once.WaitUntilDone();
    was_given |= status->ok();
    was_refused |= HasMoved(status);
    EXPECT_EQ(status->ok(), !response.positions().empty());
    here_.set_answers_left(-1, nullptr);
  }
  EXPECT_TRUE(was_given && was_refused);
}

TEST_F(MovedSessionTest, WatchesEndWithTheirDragAndRestartAtTheCommittedPose) {
  const std::string session = MakeSession();
  WatchCall watch(reactions_.get(), &deform_service_, session);
  watch.Begin(v1::WATCH_ORIGIN_REST);
  const auto stream = Drag(session);
  v1::DeformRequest pose = Pose(1);
  pose.mutable_pose()->set_commit(true);
  stream->Send(pose);
  for (bool committed = false; !committed;) {
    const auto response = stream->Receive();
    ASSERT_TRUE(response.has_value());
    committed = response->notice().has_committed();
  }
  LetLeasesRunOut();
  ReportLost();
  EXPECT_TRUE(HasMoved(stream->WaitUntilDone()));
  while (watch.Receive().has_value()) {
  }
  EXPECT_TRUE(HasMoved(watch.WaitUntilDone()));
  EXPECT_EQ(watches_.size(), 0);
  WatchCall again(reactions_.get(), &deform_service_, session);
  again.Begin(v1::WATCH_ORIGIN_COMMITTED);
  EXPECT_EQ(again.first().number(), 1);
  again.Cancel();
  again.WaitUntilDone();
}

TEST_F(MovedSessionTest, ASessionIsHeldWhileItIsWatched) {
  const std::string session = MakeSession();
  WatchCall watch(reactions_.get(), &deform_service_, session);
  watch.Begin(v1::WATCH_ORIGIN_REST);
  clock_.Advance(2 * SessionTable::kInUse);
  EXPECT_EQ(registry_.table().Evict([] { return false; }), 1);
  EXPECT_FALSE(there_.Acquire(IdOf(session)).ok());
  EXPECT_TRUE(here_.EpochOf(IdOf(session)).has_value());
  watch.Cancel();
  watch.WaitUntilDone();
}

TEST_F(MovedSessionTest, AHandedOverSessionEndsWithoutAnotherFrameAndIsFree) {
  const std::string session = MakeSession();
  const auto stream = Drag(session);
  WatchCall watch(reactions_.get(), &deform_service_, session);
  watch.Begin(v1::WATCH_ORIGIN_REST);
  Move(stream.get(), 1);
  registry_.HandOver(std::chrono::steady_clock::now() + std::chrono::seconds(30));
  EXPECT_THAT(there_.Acquire(IdOf(session)), IsOk());
  stream->Send(Pose(2));
  EXPECT_TRUE(HasMoved(stream->WaitUntilDone()));
  EXPECT_TRUE(HasMoved(watch.WaitUntilDone()));
}

}  // namespace
}  // namespace tissueform::testing
