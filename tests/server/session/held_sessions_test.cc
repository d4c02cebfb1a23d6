// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// Two servers with one store (server/session/session_registry.h).

#include <atomic>
#include <chrono>
#include <future>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/error_reason.h"
#include "tests/server/session/node.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using testing::FakeOwnership;
using testing::IsOk;
using testing::Node;
using testing::SharedSessions;
using testing::StatusIs;

constexpr int kPastTheLease = SharedSessions::kLeaseSeconds + 1;

bool IsMoved(const absl::Status& status) {
  return absl::IsUnavailable(status) && HasReason(status, ErrorReason::kSessionMoved);
}
std::string NodeIn(const absl::Status& status) {
  const ErrorMetadata metadata = ErrorInfoOf(status).metadata;
  return metadata.contains("node") ? metadata.at("node") : "";
}

class HeldSessionsTest : public ::testing::Test {
 protected:
  SharedSessions shared_;
  Node a_{&shared_, "a"};
  Node b_{&shared_, "b"};
};

TEST_F(HeldSessionsTest, TheCreatorHoldsASessionAndErrorsOfOthersNameIt) {
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> session, a_.Create("s"));
  EXPECT_THAT(session->CheckHeld(), IsOk());
  EXPECT_EQ(session->epoch(), shared_.Find("s")->epoch);
  for (const absl::Status& refused : {b_.Open("s").status(), b_.Update("s"), b_.Delete("s")}) {
    EXPECT_TRUE(IsMoved(refused)) << refused;
    EXPECT_EQ(NodeIn(refused), "a");
  }
  EXPECT_THAT(b_.Look("s"), IsOk()) << "it is only read";
  EXPECT_EQ(b_.registry.table().size(), 0);
  EXPECT_THAT(a_.Update("s"), IsOk());
  EXPECT_THAT(a_.Delete("s"), IsOk());
  EXPECT_THAT(b_.Open("s"), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_EQ(b_.registry.table().CountKnown(), 0) << "nothing of it stays known";
}

TEST_F(HeldSessionsTest, FindsASessionOfAnotherServerWithoutANotice) {
  ASSERT_THAT(a_.Create("s"), IsOk());
  EXPECT_EQ(b_.registry.table().CountKnown(), 0);
  shared_.Wait(kPastTheLease);
  EXPECT_THAT(b_.Open("s"), IsOk());
  shared_.Wait(kPastTheLease);
  EXPECT_THAT(a_.Update("s"), IsOk());
  shared_.Wait(kPastTheLease);
  EXPECT_THAT(b_.Delete("s"), IsOk());
  EXPECT_THAT(b_.Open("never"), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_THAT(b_.Update("never"), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_THAT(b_.Delete("never"), StatusIs(absl::StatusCode::kNotFound));
}

TEST_F(HeldSessionsTest, ARequestThatIsRepeatedElsewhereIsTheSameRequest) {
  ASSERT_THAT(a_.Create("s", "request"), IsOk());
  const absl::Status held = b_.Create("s", "request").status();
  EXPECT_TRUE(IsMoved(held)) << held;
  EXPECT_EQ(NodeIn(held), "a");
  EXPECT_THAT(b_.Create("s", "another"), StatusIs(absl::StatusCode::kAlreadyExists));
  shared_.Wait(kPastTheLease);
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> session, b_.Create("s", "request"));
  EXPECT_EQ(session->id(), "s");
  EXPECT_EQ(b_.registry.table().CountKnown(), 1);
}

TEST_F(HeldSessionsTest, ThePreviousHolderNeitherAnswersNorWritesATakenSession) {
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> before, a_.Create("s"));
  EXPECT_THAT(a_.Commit(before, 1), IsOk());
  shared_.Wait(kPastTheLease);
  EXPECT_TRUE(IsMoved(before->CheckHeld())) << "nobody has it yet, but somebody may";
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> after, b_.Open("s"));
  EXPECT_GT(after->epoch(), before->epoch());
  EXPECT_TRUE(IsMoved(a_.Commit(before, 2)));
  EXPECT_THAT(b_.Commit(after, 3), IsOk());
  // It was stopped, and goes on where it had looked whether it may.
  a_.ownership.set_stopped(true);
  EXPECT_THAT(before->CheckHeld(), IsOk());
  EXPECT_EQ(shared_.refused_writes(), 0);
  EXPECT_TRUE(IsMoved(a_.Commit(before, 4)));
  EXPECT_EQ(shared_.refused_writes(), 1);
  ASSERT_OK_AND_ASSIGN(const SessionView view, b_.Look("s"));
  EXPECT_EQ(view.record.last_poses[0].translation_mm.z(), 3);
  EXPECT_EQ(shared_.stale_writes(), 0);
}

TEST_F(HeldSessionsTest, ThePreviousHolderCannotWriteANewSessionOfTheSameName) {
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> before, a_.Create("s"));
  shared_.Wait(kPastTheLease);
  ASSERT_THAT(b_.Delete("s"), IsOk());
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> after, b_.Create("s"));
  a_.ownership.set_stopped(true);
  EXPECT_THAT(before->CheckHeld(), IsOk()) << "it has not heard of anything";
  EXPECT_TRUE(IsMoved(a_.Commit(before, 1)));
  EXPECT_THAT(b_.Commit(after, 2), IsOk());
  EXPECT_EQ(b_.Look("s")->record.last_poses[0].translation_mm.z(), 2);
}

TEST_F(HeldSessionsTest, ARecreatedSessionIsHeldDuringADragOfThePreviousOne) {
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> before, a_.Create("s"));
  ASSERT_THAT(a_.Delete("s"), IsOk());
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> after, a_.Create("s"));
  EXPECT_TRUE(IsMoved(before->CheckHeld()));
  EXPECT_THAT(a_.Commit(after, 1), IsOk());
}

TEST_F(HeldSessionsTest, ALostSessionLeavesMemoryAndStaysKnown) {
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> session, a_.Create("s"));
  const int64_t bytes = a_.reserved_bytes();
  a_.registry.Lost("s");
  EXPECT_EQ(a_.CountMoved("s"), 0) << "it is held";
  shared_.Wait(kPastTheLease);
  EXPECT_THAT(a_.ownership.Renew(), ::testing::ElementsAre("s"));
  a_.registry.Lost("s");
  EXPECT_EQ(a_.CountMoved("s"), 1);
  EXPECT_EQ(a_.registry.table().size(), 0);
  EXPECT_EQ(a_.registry.table().CountKnown(), 1);
  EXPECT_LT(a_.reserved_bytes(), bytes) << "though somebody has the session";
  EXPECT_TRUE(session->moved());
  EXPECT_FALSE(session->evicted()) << "no stream may open it again and go on";
  EXPECT_TRUE(IsMoved(session->Solve(session->model(), {HandlePose()}, {}).status()));
  EXPECT_THAT(a_.Open("s"), IsOk()) << "nobody else has taken it";
}

TEST_F(HeldSessionsTest, AReacquiredSessionIsLoadedAgain) {
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> before, a_.Create("s"));
  shared_.Wait(kPastTheLease);
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> after, a_.Open("s"));
  EXPECT_NE(before, after) << "another server may have had it in between";
  EXPECT_EQ(a_.CountMoved("s"), 1);
  EXPECT_TRUE(before->moved());
  EXPECT_TRUE(IsMoved(before->CheckHeld()));
  a_.registry.Lost("s");  // comes late, of the lease before
  EXPECT_EQ(a_.CountMoved("s"), 1);
  EXPECT_THAT(after->CheckHeld(), IsOk());
  EXPECT_EQ(a_.Open("s").value(), after);
}

TEST_F(HeldSessionsTest, ASessionThatIsLostWhileItIsMadeIsNotGivenOut) {
  ASSERT_THAT(a_.Create("s"), IsOk());
  shared_.Wait(kPastTheLease);
  b_.ownership.set_acquired([&] { shared_.Wait(kPastTheLease); });
  EXPECT_TRUE(IsMoved(b_.Open("s").status()));
  EXPECT_EQ(b_.registry.table().size(), 0);
  b_.ownership.set_acquired(nullptr);
  EXPECT_THAT(b_.Open("s"), IsOk());
}

// As uploads may for half a minute while the database is away.
TEST_F(HeldSessionsTest, RefusesAHeldSessionWhileAllWorkersWaitForTheStore) {
  ASSERT_THAT(a_.Create("s"), IsOk());
  const std::promise<void> store = b_.HoldUp(Lane::kStore);
  const absl::Status refused = b_.Open("s").status();
  EXPECT_TRUE(IsMoved(refused)) << refused;
  EXPECT_EQ(NodeIn(refused), "a");
}

TEST_F(HeldSessionsTest, AWaiterOfALostSessionDoesNotWaitForTheStore) {
  ASSERT_THAT(a_.Create("s"), IsOk());
  ASSERT_EQ(a_.EvictAll(), 1);
  a_.Settle();
  std::promise<void> store = a_.HoldUp(Lane::kStore);
  std::promise<absl::Status> opened;
  a_.registry.loader().Open(
      "s", std::make_shared<std::atomic<bool>>(),
      [&opened](const Node::Opened& session) { opened.set_value(session.status()); });
  while (!a_.ownership.EpochOf("s").has_value()) std::this_thread::yield();
  a_.registry.Lost("s");
  std::future<absl::Status> answer = opened.get_future();
  EXPECT_EQ(answer.wait_for(std::chrono::seconds(0)), std::future_status::timeout) << "it is held";
  shared_.Wait(kPastTheLease);
  for (const std::string& id : a_.ownership.TakeEnded()) a_.registry.Lost(id);
  const absl::Status refused = answer.get();
  EXPECT_TRUE(IsMoved(refused)) << refused;
  ASSERT_THAT(b_.Open("s"), IsOk()) << "and elsewhere it is found";
  store.set_value();
  a_.Settle();
  EXPECT_EQ(a_.registry.table().size(), 0) << "what nobody waits for is not kept";
}

// As when the database comes back: the client may have made it elsewhere, and deleted it again.
TEST_F(HeldSessionsTest, RemovesACancelledCreationWithoutItsLease) {
  a_.ownership.set_silent(true);
  a_.ownership.set_acquired([this] { a_.Cancel(); });
  EXPECT_THAT(a_.Create("s"), StatusIs(absl::StatusCode::kCancelled));
  a_.Settle();
  a_.Settle();
  EXPECT_FALSE(shared_.Find("s").has_value());
  EXPECT_THAT(b_.Open("s"), StatusIs(absl::StatusCode::kNotFound));
}

TEST_F(HeldSessionsTest, KeepsACancelledCreationThatAnotherServerHasTaken) {
  a_.ownership.set_silent(true);
  a_.ownership.set_acquired([this] {
    EXPECT_THAT(b_.Open("s"), IsOk());
    a_.Cancel();
  });
  EXPECT_THAT(a_.Create("s"), StatusIs(absl::StatusCode::kCancelled));
  a_.Settle();
  a_.Settle();
  EXPECT_THAT(b_.Open("s"), IsOk());
  EXPECT_THAT(b_.Look("s"), IsOk());
  EXPECT_EQ(shared_.stale_writes(), 0);
}

TEST_F(HeldSessionsTest, OthersMayTakeAnEvictedSessionUnlessItIsInUse) {
  for (const bool is_dragged : {false, true}) {
    SCOPED_TRACE(is_dragged);
    const std::string id = is_dragged ? "dragged" : "idle";
    ASSERT_OK_AND_ASSIGN(std::shared_ptr<Session> session, a_.Create(id));
    if (!is_dragged) session.reset();
    a_.EvictAll();
    a_.Settle();
    EXPECT_EQ(IsMoved(b_.Open(id).status()), is_dragged);
    if (!is_dragged) continue;
    session.reset();
    a_.Settle();
    EXPECT_THAT(b_.Open(id), IsOk()) << "nobody drags it any more";
  }
}

TEST_F(HeldSessionsTest, AWatchersHoldOutlivesTheSessionInMemory) {
  ASSERT_OK_AND_ASSIGN(std::shared_ptr<Session> session, a_.Create("s"));
  SessionLeaseHandlePtr hold = session->hold();
  session.reset();
  a_.EvictAll();
  a_.Settle();
  EXPECT_THAT(hold->Check(), IsOk());
  EXPECT_TRUE(IsMoved(b_.Open("s").status()));
  hold.reset();
  a_.Settle();
  EXPECT_EQ(a_.ownership.releases(), 1);
  EXPECT_THAT(b_.Open("s"), IsOk());
}

TEST_F(HeldSessionsTest, ReleasesASessionThatCannotBeLoadedBeforeItAnswers) {
  ASSERT_THAT(a_.Create("s"), IsOk());
  shared_.Wait(kPastTheLease);
  // Unknown to b, whose catalog has lost the mesh.
  const absl::Status removed = b_.registry.table().RemoveMesh(a_.Look("s")->record.mesh_sha256);
  ASSERT_THAT(removed, IsOk());
  EXPECT_THAT(b_.Open("s"), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_TRUE(shared_.Find("s")->node.empty());
  EXPECT_EQ(b_.registry.table().CountKnown(), 1) << "the mesh is gone, not the session";
  EXPECT_THAT(a_.Open("s"), IsOk());
}

TEST_F(HeldSessionsTest, LearnsOfOthersChangesAndIgnoresItsOwn) {
  ASSERT_THAT(a_.Create("s", "request"), IsOk());
  SessionRecord record = a_.Look("s")->record;
  a_.registry.sync().OnChanged(record);
  a_.registry.sync().OnChanged(record);
  a_.registry.sync().OnDeleted("s");
  EXPECT_EQ(a_.registry.table().size(), 1) << "it is held: whoever deletes it takes it first";
  b_.registry.sync().OnChanged(record);
  b_.registry.sync().OnChanged(record);
  EXPECT_EQ(b_.registry.table().CountMadeFrom(record.mesh_sha256), 1);
  EXPECT_TRUE(IsMoved(b_.Create("", "request").status())) << "the same request, to be called at a";
  record.mesh_sha256 = std::string(64, 'f');
  b_.registry.sync().OnChanged(record);
  EXPECT_EQ(b_.registry.table().CountMadeFrom(record.mesh_sha256), 1);
  b_.registry.sync().OnDeleted("s");
  b_.registry.sync().OnDeleted("s");
  EXPECT_EQ(b_.registry.table().CountKnown(), 0);
}

TEST_F(HeldSessionsTest, RemovesOnlyUnheldSessionsForTheirAge) {
  ASSERT_THAT(a_.Create("held"), IsOk());
  ASSERT_THAT(a_.Create("free"), IsOk());
  a_.EvictAll();
  a_.Settle();
  ASSERT_THAT(a_.Open("held"), IsOk());
  ASSERT_THAT(b_.registry.sync().LearnAll(), IsOk());
  EXPECT_EQ(b_.registry.sync().RemoveUnused({"held", "free", "never"}, b_.clock.Now()), 1);
  EXPECT_THAT(a_.Look("held"), IsOk());
  EXPECT_THAT(a_.Look("free"), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_TRUE(b_.registry.table().Knows("held"));
}

TEST_F(HeldSessionsTest, HandingOverReleasesAllSessionsAndTakesNoMore) {
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> dragged, a_.Create("dragged"));
  ASSERT_THAT(a_.Create("loaded"), IsOk());
  ASSERT_THAT(a_.Commit(dragged, 1), IsOk());
  a_.registry.HandOver(std::chrono::steady_clock::now() + std::chrono::seconds(30));
  EXPECT_TRUE(IsMoved(dragged->CheckHeld()));
  EXPECT_TRUE(IsMoved(a_.Commit(dragged, 2)));
  EXPECT_TRUE(IsMoved(a_.Open("loaded").status()));
  EXPECT_EQ(a_.registry.table().size(), 0);
  for (const char* id : {"dragged", "loaded"}) {
    EXPECT_EQ(a_.CountMoved(id), 1);
    EXPECT_THAT(b_.Open(id), IsOk()) << "at once, no lease has to run out";
  }
  EXPECT_EQ(b_.Look("dragged")->record.last_poses[0].translation_mm.z(), 1);
  // Its client asks again with the same name, elsewhere.
  EXPECT_THAT(a_.Create("late"), IsOk()) << "the record is kept";
  EXPECT_THAT(b_.Open("late"), IsOk());
}

TEST_F(HeldSessionsTest, ConcurrentServersNeverWriteOthersSessionsNorLeak) {
  const int64_t a_bytes = a_.reserved_bytes();
  const int64_t b_bytes = b_.reserved_bytes();
  const std::vector<std::string> ids = {"q", "r", "s", "t", "u", "v", "w", "x", "y", "z"};
  for (const std::string& id : ids) ASSERT_THAT(a_.Create(id), IsOk());
  const auto work = [&](uint32_t seed) {
    std::mt19937 random(seed);
    Node& node = seed % 2 == 0 ? a_ : b_;
    std::vector<std::shared_ptr<Session>> drags;
    for (int step = 0; step < 300; ++step) {
      const std::string& id = ids[random() % ids.size()];
      absl::Status outcome;
      switch (random() % 9) {
        case 0:
          outcome = node.Look(id).status();
          break;
        case 1:
          if (random() % 16 != 0) break;
          outcome = node.Delete(id);
          if (outcome.ok()) outcome = node.Create(id).status();
          // Who asked for it in the moment before has learnt of the one that is gone.
          if (HasReason(outcome, ErrorReason::kSessionIdTaken)) outcome = absl::OkStatus();
          break;
        case 2:
          outcome = node.Update(id);
          break;
        case 3:
          node.EvictAll();
          break;
        case 4:
          drags.clear();
          break;
        case 5:
          if (random() % 4 == 0) shared_.Wait(kPastTheLease / 2);
          for (const std::string& lost : node.ownership.Renew()) node.registry.Lost(lost);
          break;
        default:
          if (Node::Opened opened = node.Open(id); opened.ok()) {
            outcome = node.Commit(*opened, step);
            drags.push_back(*std::move(opened));
          } else {
            outcome = opened.status();
          }
      }
      const std::string reason = outcome.ok() ? "" : ReasonOf(outcome);
      EXPECT_THAT(reason, ::testing::AnyOf("", "SESSION_MOVED", "SESSION_NOT_FOUND",
                                           "SESSION_UPDATED", "STALE_ETAG"))
          << outcome;
    }
  };
  std::vector<std::thread> threads;
  for (uint32_t seed = 0; seed < 6; ++seed) threads.emplace_back(work, seed);
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(shared_.stale_writes(), 0);
  for (Node* node : {&a_, &b_}) {
    node->EvictAll();
    node->Settle();
  }
  for (const std::string& id : ids) {
    if (const auto lease = shared_.Find(id); lease.has_value()) {
      EXPECT_TRUE(lease->node.empty() || lease->until <= shared_.now()) << "nobody needs it";
    }
  }
  EXPECT_EQ(a_.reserved_bytes(), a_bytes);
  EXPECT_EQ(b_.reserved_bytes(), b_bytes);
}

TEST_F(HeldSessionsTest, AReleaseDoesNotTakeASessionFromAConcurrentOpen) {
  ASSERT_THAT(a_.Create("s"), IsOk());
  for (int i = 0; i < 200; ++i) {
    // Given back on one thread while it is asked for on another.
    ASSERT_EQ(a_.EvictAll(), 1);
    ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> session, a_.Open("s"));
    a_.Settle();
    ASSERT_THAT(session->CheckHeld(), IsOk());
  }
}

}  // namespace
}  // namespace tissueform
