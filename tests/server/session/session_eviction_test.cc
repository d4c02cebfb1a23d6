// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// Sessions that leave memory and come back from their records (server/session/session_registry.h).

#include <algorithm>
#include <atomic>
#include <future>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/error_reason.h"
#include "server/session/memory_reclaimer.h"
#include "server/session/session_registry.h"
#include "tests/testing/fake_clock.h"
#include "tests/testing/in_memory_stores.h"
#include "tests/testing/meshes.h"
#include "tests/testing/session_samples.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using testing::Bar;
using testing::BarRecord;
using testing::FakeClock;
using testing::IsOk;
using testing::SampleMesh;
using testing::StatusIs;
using testing::Store;

using Opened = absl::StatusOr<std::shared_ptr<Session>>;

class SessionEvictionTest : public ::testing::Test {
 protected:
  SessionEvictionTest() {
    Restart();
    bar_ = Store(SampleMesh(Bar({2, 2, 3})), &catalog_);
    mesh_bytes_ = budget_.reserved_bytes();
  }

  // A registry that knows what the store has.
  void Restart(int max_sessions = 64) {
    limits_.max_sessions = max_sessions;
    pool_.reset();
    registry_.reset();
    pool_ = std::make_unique<WorkerPool>(1);
    registry_ = std::make_unique<SessionRegistry>(limits_, &budget_, pool_.get(), &store_,
                                                  &catalog_, &clock_);
    ASSERT_THAT(registry_->sync().LearnAll(), IsOk());
  }

  // A session of that id; empty: the store's choice.
  std::future<Opened> Create(
      const std::string& id, const std::string& request_id = "",
      SessionLoader::CancelFlag cancelled = std::make_shared<std::atomic<bool>>()) {
    SessionRecord record = BarRecord(*bar_);
    record.id = id;
    record.request_id = request_id;
    auto promise = std::make_shared<std::promise<Opened>>();
    registry_->loader().Create(
        std::move(record), bar_, std::move(cancelled),
        [promise](Opened session) { promise->set_value(std::move(session)); });
    return promise->get_future();
  }

  // With this owner.
  Opened CreateOf(const std::string& owner, const std::string& request_id = "") {
    SessionRecord record = BarRecord(*bar_);
    record.owner = owner;
    record.request_id = request_id;
    std::promise<Opened> promise;
    registry_->loader().Create(
        std::move(record), bar_, std::make_shared<std::atomic<bool>>(),
        [&promise](Opened session) { promise.set_value(std::move(session)); });
    return promise.get_future().get();
  }

  std::future<Opened> Open(const std::string& id, SessionLoader::CancelFlag cancelled =
                                                      std::make_shared<std::atomic<bool>>()) {
    auto promise = std::make_shared<std::promise<Opened>>();
    registry_->loader().Open(id, std::move(cancelled),
                             [promise](Opened session) { promise->set_value(std::move(session)); });
    return promise->get_future();
  }

  absl::Status Delete(const std::string& id) {
    std::promise<absl::Status> done;
    registry_->sync().Delete(id,
                             [&done](absl::Status status) { done.set_value(std::move(status)); });
    return done.get_future().get();
  }

  SessionRecord Kept(const std::string& id) {
    SessionRecord kept;
    store_.Get(id, [&kept](absl::StatusOr<SessionRecord> record) { kept = *std::move(record); });
    return kept;
  }

  int EvictAll() {
    return registry_->table().Evict([] { return false; });
  }

  // Holds the only batch worker until the result is set.
  std::promise<void> HoldWorker() {
    std::promise<void> release;
    pool_->Post(Lane::kBatch, [held = release.get_future().share()] { held.wait(); });
    return release;
  }

  static Positions Answer(Session& session) {
    HandlePose pose;
    pose.translation_mm = {1, 2, 3};
    const auto answer = session.Solve(session.model(), {pose}, {});
    EXPECT_THAT(answer, IsOk());
    return answer.ok() ? answer->positions : Positions();
  }

  FakeClock clock_;
  ServiceLimits limits_;
  MemoryBudget budget_{64 << 20};
  MeshCatalog catalog_{limits_, &budget_, nullptr, &clock_};
  InMemorySessionStore store_;
  std::unique_ptr<SessionRegistry> registry_;
  std::unique_ptr<WorkerPool> pool_;
  std::shared_ptr<const StoredMesh> bar_;
  int64_t mesh_bytes_ = 0;
};

TEST_F(SessionEvictionTest, EvictableBytesAreThoseThatEvictionWouldFree) {
  EXPECT_EQ(registry_->table().EvictableBytes(), 0);
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> first, Create("first").get());
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> second, Create("second").get());
  ASSERT_EQ(first->shared_preparation(), second->shared_preparation());
  EXPECT_EQ(registry_->table().EvictableBytes(), 0) << "they were used until now";
  clock_.Advance(2 * SessionTable::kInUse);
  second->Touch();
  EXPECT_EQ(registry_->table().EvictableBytes(), first->own_bytes())
      << "the other needs what they share";
  clock_.Advance(2 * SessionTable::kInUse);
  EXPECT_EQ(registry_->table().EvictableBytes(), budget_.reserved_bytes() - mesh_bytes_);
  EXPECT_EQ(EvictAll(), 2);
  EXPECT_EQ(registry_->table().EvictableBytes(), 0);
}

TEST_F(SessionEvictionTest, EvictsUnusedSessionsAndRestoresTheSameAnswers) {
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> before, Create("bar").get());
  const Positions answer = Answer(*before);
  clock_.Advance(SessionTable::kInUse);
  EXPECT_EQ(EvictAll(), 0) << "it was used until now";
  clock_.Advance(std::chrono::nanoseconds(1));
  EXPECT_EQ(EvictAll(), 1);
  EXPECT_EQ(registry_->table().size(), 0);
  EXPECT_EQ(budget_.reserved_bytes(), mesh_bytes_) << "though somebody holds it";
  EXPECT_TRUE(before->evicted());
  EXPECT_THAT(before->Solve(before->model(), {HandlePose()}, {}),
              StatusIs(absl::StatusCode::kNotFound));

  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> after, Open("bar").get());
  EXPECT_NE(after, before);
  EXPECT_EQ(Answer(*after), answer) << "to the last bit";
  EXPECT_EQ(registry_->table().size(), 1);
  EXPECT_EQ(Open("bar").get().value(), after);
}

TEST_F(SessionEvictionTest, StoresTheVertexOrderAndReusesIt) {
  bar_ = Store(SampleMesh(Bar({4, 4, 8})), &catalog_);
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> before, Create("bar").get());
  SessionRecord record = Kept("bar");
  EXPECT_EQ(record.node_order.size(), static_cast<size_t>(bar_->mesh.num_vertices()));
  const auto factor_bytes_in = [&](std::vector<int32_t> order) {
    record.node_order = std::move(order);
    store_.Update(record, 1, [&](absl::StatusOr<SessionRecord> kept) { record = *kept; });
    Restart();
    const Opened after = Open("bar").get();
    return after.ok() ? (*after)->preparation().factor_bytes : 0;
  };
  const int64_t found = before->preparation().factor_bytes;
  const std::vector<int32_t> order = record.node_order;
  EXPECT_EQ(factor_bytes_in(order), found);
  std::vector<int32_t> shuffled = order;
  std::shuffle(shuffled.begin(), shuffled.end(), std::mt19937(3));
  EXPECT_GT(factor_bytes_in(shuffled), found) << "the kept order was not used";
  EXPECT_EQ(factor_bytes_in({2, 0, 1}), found) << "that of another mesh";
}

TEST_F(SessionEvictionTest, EvictsLeastRecentlyUsedFirstAndNoMoreThanNeeded) {
  for (const char* id : {"a", "b", "c"}) {
    ASSERT_THAT(Create(id).get(), IsOk());
    clock_.Advance(std::chrono::seconds(1));
  }
  ASSERT_THAT(Open("a").get(), IsOk());
  clock_.Advance(2 * SessionTable::kInUse);
  int asked = 0;
  EXPECT_EQ(registry_->table().Evict([&asked] { return ++asked > 2; }), 2);
  EXPECT_THAT(registry_->table().Find("a"), IsOk());
  EXPECT_FALSE(registry_->table().Find("b").ok());
  EXPECT_FALSE(registry_->table().Find("c").ok());
}

TEST_F(SessionEvictionTest, AFullServerMakesRoomByEvictionOrRefuses) {
  Restart(/*max_sessions=*/1);
  ASSERT_THAT(Create("a").get(), IsOk());
  EXPECT_THAT(Create("b").get(),
              StatusIs(absl::StatusCode::kResourceExhausted, ::testing::HasSubstr("in use")));
  clock_.Advance(2 * SessionTable::kInUse);
  EXPECT_THAT(Create("b").get(), IsOk());
  EXPECT_THAT(Open("a").get(), StatusIs(absl::StatusCode::kResourceExhausted));
  clock_.Advance(2 * SessionTable::kInUse);
  EXPECT_THAT(Open("a").get(), IsOk());
  EXPECT_EQ(registry_->table().size(), 1);
}

TEST_F(SessionEvictionTest, ARestartKnowsItsSessionsAndTheirRequests) {
  ASSERT_THAT(Create("a", "request").get(), IsOk());
  Restart();
  EXPECT_EQ(registry_->table().size(), 0);
  EXPECT_THAT(Create("a").get(), StatusIs(absl::StatusCode::kAlreadyExists));
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> again, Create("other", "request").get());
  EXPECT_EQ(again->id(), "a");
  // Its first owner has seen the name: who joined and went away does not take it along.
  registry_->sync().Abandon(again);
  EXPECT_THAT(registry_->table().Find("a"), IsOk());
  EXPECT_THAT(Delete("a"), IsOk());
  EXPECT_THAT(Open("a").get(), StatusIs(absl::StatusCode::kNotFound));
}

TEST_F(SessionEvictionTest, OpenersShareOneRestore) {
  ASSERT_THAT(Create("a").get(), IsOk());
  Restart();
  std::promise<void> release = HoldWorker();
  std::future<Opened> first = Open("a");
  std::future<Opened> second = Open("a");
  release.set_value();
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> session, first.get());
  EXPECT_EQ(second.get().value(), session);
}

TEST_F(SessionEvictionTest, ACancelledOpenerIsAnsweredAtOnceAndTheOthersGetTheSession) {
  ASSERT_THAT(Create("a").get(), IsOk());
  Restart();
  std::promise<void> release = HoldWorker();
  const auto cancelled = std::make_shared<std::atomic<bool>>();
  std::future<Opened> impatient = Open("a", cancelled);
  *cancelled = true;
  registry_->loader().CancelWait(cancelled);
  EXPECT_THAT(impatient.get(), StatusIs(absl::StatusCode::kCancelled));
  std::future<Opened> patient = Open("a");  // joins what no caller waits for
  release.set_value();
  EXPECT_THAT(patient.get(), IsOk());
}

TEST_F(SessionEvictionTest, ACreationThatJoinedARestoreAndWasCancelledLeavesNoClaim) {
  ASSERT_THAT(Create("a", "request").get(), IsOk());
  Restart();
  std::promise<void> release = HoldWorker();
  std::future<Opened> patient = Open("a");
  const auto cancelled = std::make_shared<std::atomic<bool>>();
  std::future<Opened> again = Create("other", "request", cancelled);
  *cancelled = true;
  registry_->loader().CancelWait(cancelled);
  EXPECT_THAT(again.get(), StatusIs(absl::StatusCode::kCancelled));
  release.set_value();
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> session, patient.get());
  // The one claim that is left is that of the first creation.
  registry_->sync().Abandon(session);
  EXPECT_THAT(Open("a").get(), StatusIs(absl::StatusCode::kNotFound));
}

TEST_F(SessionEvictionTest, ACreationThatJoinedARestoreAndWasAnsweredHasAClaim) {
  ASSERT_THAT(Create("a", "request").get(), IsOk());
  Restart();
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> session, Create("other", "request").get());
  registry_->sync().Abandon(session);
  EXPECT_THAT(registry_->table().Find("a"), IsOk());
  registry_->sync().Abandon(session);
  EXPECT_THAT(Open("a").get(), StatusIs(absl::StatusCode::kNotFound));
}

TEST_F(SessionEvictionTest, SessionDeletedDuringItsRestoreStaysDeleted) {
  ASSERT_THAT(Create("a").get(), IsOk());
  Restart();
  std::promise<void> release = HoldWorker();
  std::future<Opened> opened = Open("a");
  EXPECT_THAT(Delete("a"), IsOk());
  release.set_value();
  EXPECT_THAT(opened.get(), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_EQ(budget_.reserved_bytes(), mesh_bytes_);
  EXPECT_THAT(Open("a").get(), StatusIs(absl::StatusCode::kNotFound));
}

TEST_F(SessionEvictionTest, AStoreThatAnswersAtTheEndFindsNoPool) {
  ASSERT_THAT(Create("a").get(), IsOk());
  Restart();
  registry_->Stop();
  pool_.reset();
  EXPECT_THAT(Open("a").get(), StatusIs(absl::StatusCode::kUnavailable));
}

TEST_F(SessionEvictionTest, CommittedPosesAreInTheRecord) {
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> session, Create("a").get());
  HandlePose pose;
  pose.translation_mm = {4, 5, 6};
  std::promise<absl::Status> committed;
  registry_->sync().CommitPoses(session, {pose}, [&committed](absl::Status status) {
    committed.set_value(std::move(status));
  });
  EXPECT_THAT(committed.get_future().get(), IsOk());
  std::promise<absl::StatusOr<SessionView>> looked;
  registry_->sync().Look(
      "a", [&looked](absl::StatusOr<SessionView> view) { looked.set_value(std::move(view)); });
  ASSERT_OK_AND_ASSIGN(const SessionView view, looked.get_future().get());
  ASSERT_EQ(view.record.last_poses.size(), 1U);
  EXPECT_EQ(view.record.last_poses[0].translation_mm, pose.translation_mm);
}

TEST_F(SessionEvictionTest, OneOwnersSessionsLeaveForItWithoutTouchingThoseOfOthers) {
  ASSERT_THAT(CreateOf("ann"), IsOk());
  ASSERT_THAT(CreateOf("bob"), IsOk());
  ASSERT_THAT(CreateOf("bob"), IsOk());
  clock_.Advance(std::chrono::hours(1));
  EXPECT_EQ(registry_->table().Evict([] { return false; }, "bob"), 2);
  EXPECT_EQ(registry_->table().size(), 1);
  EXPECT_EQ(registry_->table().Evict([] { return false; }, "nobody"), 0);
}

TEST_F(SessionEvictionTest, AReservationThatDoesNotFitGetsTheRoomOfUnusedSessions) {
  const MemoryReclaimer reclaimer(limits_, &budget_, registry_.get(), &catalog_);
  ASSERT_THAT(Create("a").get(), IsOk());
  const int64_t more = budget_.limit_bytes() - budget_.reserved_bytes() + 1;
  EXPECT_THAT(budget_.Reserve(more, "mesh"), StatusIs(absl::StatusCode::kResourceExhausted));
  EXPECT_EQ(registry_->table().size(), 1) << "it is in use";
  clock_.Advance(2 * SessionTable::kInUse);
  EXPECT_THAT(budget_.Reserve(more, "mesh"), IsOk());
  EXPECT_EQ(registry_->table().size(), 0);
  EXPECT_THAT(Open("a").get(), IsOk());
}

TEST_F(SessionEvictionTest, AReservationOfAnOwnerGetsTheRoomOfThatOwnersSessions) {
  constexpr int64_t kAccount = 16 << 20;
  budget_.set_account_limit(kAccount);
  const MemoryReclaimer reclaimer(limits_, &budget_, registry_.get(), &catalog_);
  ASSERT_THAT(CreateOf("ann"), IsOk());
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> of_bob, CreateOf("bob"));
  clock_.Advance(2 * SessionTable::kInUse);
  EXPECT_THAT(budget_.AccountOf("ann")->Reserve(kAccount, "session"), IsOk());
  EXPECT_EQ(registry_->table().Loaded(), std::vector{of_bob});
}

TEST_F(SessionEvictionTest, SessionQuotaLimitsAnOwnerWithoutAffectingOthers) {
  registry_->table().set_max_of_owner(2);
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> first, CreateOf("ann", "first"));
  ASSERT_THAT(CreateOf("ann"), IsOk());
  const Opened third = CreateOf("ann");
  EXPECT_THAT(third, StatusIs(absl::StatusCode::kResourceExhausted));
  EXPECT_EQ(ReasonOf(third.status()), "QUOTA_EXCEEDED");
  EXPECT_EQ(ErrorInfoOf(third.status()).metadata.at("quota"), "sessions");
  EXPECT_EQ(CreateOf("ann", "first").value(), first) << "the same request again is none more";
  EXPECT_THAT(CreateOf("bob"), IsOk());
  EXPECT_THAT(CreateOf(""), IsOk());
  EXPECT_THAT(Delete(first->id()), IsOk());
  EXPECT_THAT(CreateOf("ann"), IsOk());
}

TEST_F(SessionEvictionTest, SessionsOfEarlierServersCountForTheirOwner) {
  ASSERT_THAT(CreateOf("ann"), IsOk());
  Restart();
  registry_->table().set_max_of_owner(1);
  EXPECT_THAT(CreateOf("ann"), StatusIs(absl::StatusCode::kResourceExhausted));
  EXPECT_THAT(CreateOf("bob"), IsOk());
}

}  // namespace
}  // namespace tissueform
