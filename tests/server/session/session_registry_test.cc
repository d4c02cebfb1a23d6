// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/session_registry.h"

#include <atomic>
#include <functional>
#include <future>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "server/session/memory_reclaimer.h"
#include "tests/testing/fake_clock.h"
#include "tests/testing/in_memory_stores.h"
#include "tests/testing/meshes.h"
#include "tests/testing/session_samples.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::tissueform::testing::Bar;
using ::tissueform::testing::BarRecord;
using ::tissueform::testing::FakeClock;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::SampleMesh;
using ::tissueform::testing::StatusIs;
using ::tissueform::testing::Store;

constexpr std::chrono::nanoseconds kTick{1};
const std::chrono::seconds kTtl = ServiceLimits().session_idle_ttl;

// What a client says of a creation.
struct Key {
  std::string request_id;
  std::string fingerprint;
  std::string session_id;
};

using CreateResult = absl::StatusOr<std::shared_ptr<Session>>;

// Lets a test do something when a session has been made and its record is about to be kept.
class WatchedStore : public InMemorySessionStore {
 public:
  void Create(SessionRecord record, int64_t epoch, RecordCallback done) override {
    if (before_create) before_create();
    InMemorySessionStore::Create(std::move(record), epoch, std::move(done));
  }

  std::function<void()> before_create;
};

// A server's inside without its network. One worker, so that a blocked worker holds everything.
class SessionRegistryTest : public ::testing::Test {
 protected:
  SessionRegistryTest() { Restart({}); }
  ~SessionRegistryTest() override { pool_.reset(); }

  void Restart(const ServiceLimits& limits, int64_t budget_bytes = 64 << 20) {
    pool_.reset();
    reclaimer_.reset();
    registry_.reset();
    bar_.reset();
    catalog_.reset();
    budget_ = std::make_unique<MemoryBudget>(budget_bytes);
    catalog_ = std::make_unique<MeshCatalog>(limits, budget_.get(), nullptr, &clock_);
    pool_ = std::make_unique<WorkerPool>(1);
    registry_ = std::make_unique<SessionRegistry>(limits, budget_.get(), pool_.get(), &store_,
                                                  catalog_.get(), &clock_);
    reclaimer_ =
        std::make_unique<MemoryReclaimer>(limits, budget_.get(), registry_.get(), catalog_.get());
    bar_ = Store(SampleMesh(Bar({2, 2, 3})), catalog_.get());
    mesh_bytes_ = budget_->reserved_bytes();
  }

  std::future<CreateResult> Create(const Key& key = {}, SessionLoader::CancelFlag cancelled =
                                                            std::make_shared<std::atomic<bool>>()) {
    auto promise = std::make_shared<std::promise<CreateResult>>();
    SessionRecord record = BarRecord(*bar_);
    record.id = key.session_id;
    record.request_id = key.request_id;
    record.request_fingerprint = key.fingerprint;
    registry_->loader().Create(
        std::move(record), bar_, std::move(cancelled),
        [promise](CreateResult result) { promise->set_value(std::move(result)); });
    return promise->get_future();
  }

  absl::Status Delete(const std::string& id) {
    std::promise<absl::Status> done;
    registry_->sync().Delete(id,
                             [&done](absl::Status status) { done.set_value(std::move(status)); });
    return done.get_future().get();
  }

  // Runs what is queued at the moment.
  void Drain() {
    for (const Lane lane : {Lane::kBatch, Lane::kSolves}) {
      std::promise<void> reached;
      pool_->Post(lane, [&reached] { reached.set_value(); });
      reached.get_future().wait();
    }
  }

  // The ids in the store, in order.
  std::vector<std::string> Stored() {
    std::vector<std::string> ids;
    store_.List({.owner = "", .after = "", .limit = 1000},
                [&ids](const absl::StatusOr<SessionStore::Page>& page) {
                  for (const SessionRecord& record : page->records) ids.push_back(record.id);
                });
    return ids;
  }

  FakeClock clock_;
  WatchedStore store_;
  std::unique_ptr<MemoryBudget> budget_;
  std::unique_ptr<MeshCatalog> catalog_;
  std::unique_ptr<WorkerPool> pool_;
  std::unique_ptr<SessionRegistry> registry_;
  std::unique_ptr<MemoryReclaimer> reclaimer_;
  std::shared_ptr<const StoredMesh> bar_;
  int64_t mesh_bytes_ = 0;
};

TEST_F(SessionRegistryTest, ReservesWhatTheSessionHoldsAndFreesItOnDelete) {
  std::string id;
  {
    ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> session, Create().get());
    id = session->id();
    EXPECT_GT(session->bytes_held(), session->preparation().factor_bytes);
    EXPECT_EQ(budget_->reserved_bytes(), mesh_bytes_ + session->bytes_held());
    EXPECT_THAT(registry_->table().Find(id), IsOk());
    // A holder does not keep the memory.
    EXPECT_THAT(Delete(id), IsOk());
    EXPECT_EQ(budget_->reserved_bytes(), mesh_bytes_);
  }
  EXPECT_THAT(registry_->table().Find(id), StatusIs(absl::StatusCode::kNotFound, HasSubstr(id)));
  EXPECT_THAT(Delete(id), StatusIs(absl::StatusCode::kNotFound, HasSubstr(id)));
}

TEST_F(SessionRegistryTest, ADeletedSessionAnswersNoMorePoses) {
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> session, Create().get());
  ASSERT_THAT(Delete(session->id()), IsOk());
  std::promise<absl::Status> status;
  session->strand().Post(Lane::kSolves, [&] {
    status.set_value(session->Solve(session->model(), {HandlePose{}}, DeformControl{}).status());
  });
  EXPECT_THAT(status.get_future().get(),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("delete")));
}

TEST_F(SessionRegistryTest, TheFactorIsRefusedBeforeItIsComputed) {
  // Room for the estimate, but not for one more byte.
  int64_t factor_bytes = 0;
  {
    // Gone before the budget that it takes from.
    ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> probe, Create().get());
    factor_bytes = probe->preparation().factor_bytes;
    ASSERT_THAT(Delete(probe->id()), IsOk());
  }
  ASSERT_GT(factor_bytes, 0);
  for (int64_t limit = mesh_bytes_;; limit += factor_bytes / 2) {
    Restart({}, limit + (1 << 20));  // a MiB for the upload's own checks
    const MemoryReservation rest =
        *budget_->Reserve(budget_->limit_bytes() - limit, "rest of the machine");
    const CreateResult result = Create().get();
    if (result.ok()) break;
    EXPECT_EQ(result.status().code(), absl::StatusCode::kResourceExhausted) << result.status();
    EXPECT_EQ(budget_->reserved_bytes() - rest.bytes(), mesh_bytes_) << "something was left behind";
    if (absl::StrContains(result.status().message(), "matrix factor")) return;
  }
  FAIL() << "no budget was refused for the factor";
}

TEST_F(SessionRegistryTest, TheSameRequestIdGivesTheSameSession) {
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> first, Create({"id", "print", ""}).get());
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> again, Create({"id", "print", ""}).get());
  EXPECT_EQ(first, again);
  EXPECT_THAT(Create({"id", "other", ""}).get(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("request_id")));
  ASSERT_THAT(Delete(first->id()), IsOk());
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> fresh, Create({"id", "other", ""}).get());
  EXPECT_NE(fresh, first);
}

TEST_F(SessionRegistryTest, RequestsWithoutIdGetSessionsOfTheirOwn) {
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> first, Create().get());
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> second, Create().get());
  EXPECT_NE(first->id(), second->id());
}

TEST_F(SessionRegistryTest, ConcurrentCallsWithOneRequestIdShareTheWork) {
  std::promise<void> go;
  pool_->Post(Lane::kBatch, [&go] { go.get_future().wait(); });
  std::future<CreateResult> first = Create({"id", "print", ""});
  std::future<CreateResult> second = Create({"id", "print", ""});
  std::future<CreateResult> other = Create({"id", "other", ""});
  EXPECT_THAT(other.get(), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("request_id")));
  go.set_value();
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> one, first.get());
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> two, second.get());
  EXPECT_EQ(one, two);
  EXPECT_EQ(registry_->table().size(), 1);
}

TEST_F(SessionRegistryTest, ACancelledCreationLeavesNothingBehind) {
  std::promise<void> go;
  pool_->Post(Lane::kBatch, [&go] { go.get_future().wait(); });
  const auto cancelled = std::make_shared<std::atomic<bool>>(false);
  std::future<CreateResult> result = Create({}, cancelled);
  *cancelled = true;
  go.set_value();
  EXPECT_THAT(result.get(), StatusIs(absl::StatusCode::kCancelled, HasSubstr("cancel")));
  Drain();
  EXPECT_EQ(registry_->table().size(), 0);
  EXPECT_EQ(budget_->reserved_bytes(), mesh_bytes_);
}

TEST_F(SessionRegistryTest, CancelledCallerIsAnsweredAtOnceAndItsWorkEnds) {
  std::promise<void> go;
  pool_->Post(Lane::kBatch, [&go] { go.get_future().wait(); });
  const auto cancelled = std::make_shared<std::atomic<bool>>(false);
  std::future<CreateResult> result = Create({"id", "print", "chosen"}, cancelled);
  *cancelled = true;
  registry_->loader().CancelWait(cancelled);
  // The worker has not begun.
  EXPECT_THAT(result.get(), StatusIs(absl::StatusCode::kCancelled, HasSubstr("canceled")));
  EXPECT_THAT(Create({"", "", "chosen"}).get(), StatusIs(absl::StatusCode::kAlreadyExists))
      << "another request must wait";
  go.set_value();
  Drain();
  EXPECT_EQ(registry_->table().size(), 0);
  EXPECT_EQ(budget_->reserved_bytes(), mesh_bytes_);
  EXPECT_THAT(Stored(), ::testing::IsEmpty());
  EXPECT_THAT(Create({"id", "print", "chosen"}).get(), IsOk());
}

TEST_F(SessionRegistryTest, RepeatedRequestJoinsACancelledCreationBeforeItStops) {
  std::promise<void> go;
  pool_->Post(Lane::kBatch, [&go] { go.get_future().wait(); });
  const auto cancelled = std::make_shared<std::atomic<bool>>(true);
  std::future<CreateResult> gone = Create({"id", "print", "chosen"}, cancelled);
  registry_->loader().CancelWait(cancelled);
  EXPECT_THAT(gone.get(), StatusIs(absl::StatusCode::kCancelled));
  std::future<CreateResult> again = Create({"id", "print", "chosen"});
  go.set_value();
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> session, again.get());
  Drain();
  EXPECT_EQ(registry_->table().size(), 1);
  EXPECT_EQ(budget_->reserved_bytes(), mesh_bytes_ + session->bytes_held());
  EXPECT_THAT(Stored(), ::testing::ElementsAre("chosen"));
}

TEST_F(SessionRegistryTest, RepeatedRequestResumesACreationCancelledInThatStage) {
  const auto cancelled = std::make_shared<std::atomic<bool>>(false);
  std::future<CreateResult> again;
  std::promise<CreateResult> first;
  SessionRecord record = BarRecord(*bar_);
  record.request_id = "id";
  record.request_fingerprint = "print";
  registry_->loader().Create(
      record, bar_, cancelled,
      [&first](CreateResult result) { first.set_value(std::move(result)); },
      [&](const SessionProgress& progress) {
        if (progress.stage != SessionStage::kOrdering) return;
        *cancelled = true;
        registry_->loader().CancelWait(cancelled);
        // On this very worker: it goes on to its next stage afterwards.
        again = Create({"id", "print", ""});
      });
  EXPECT_THAT(first.get_future().get(), StatusIs(absl::StatusCode::kCancelled));
  Drain();
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> session, again.get());
  EXPECT_EQ(registry_->table().size(), 1);
  EXPECT_EQ(budget_->reserved_bytes(), mesh_bytes_ + session->bytes_held());
}

TEST_F(SessionRegistryTest, RemovesAFinishedSessionThatNoCallerAwaits) {
  const auto cancelled = std::make_shared<std::atomic<bool>>(false);
  // After its last stage: too late to stop early.
  store_.before_create = [&] { registry_->loader().CancelWait(cancelled); };
  EXPECT_THAT(Create({}, cancelled).get(),
              StatusIs(absl::StatusCode::kCancelled, HasSubstr("canceled")));
  Drain();
  EXPECT_EQ(registry_->table().size(), 0);
  EXPECT_EQ(budget_->reserved_bytes(), mesh_bytes_);
  EXPECT_THAT(Stored(), ::testing::IsEmpty());
}

TEST_F(SessionRegistryTest, OneCancelledCallerDoesNotAffectTheOther) {
  std::promise<void> go;
  pool_->Post(Lane::kBatch, [&go] { go.get_future().wait(); });
  const auto cancelled = std::make_shared<std::atomic<bool>>(true);
  std::future<CreateResult> gone = Create({"id", "print", ""}, cancelled);
  std::future<CreateResult> stays = Create({"id", "print", ""});
  go.set_value();
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> session, gone.get());
  ASSERT_THAT(stays.get(), IsOk());
  registry_->sync().Abandon(session);  // what the cancelled call does at its end
  EXPECT_THAT(registry_->table().Find(session->id()), IsOk());
  registry_->sync().Abandon(session);
  EXPECT_THAT(registry_->table().Find(session->id()),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("it was deleted")));
  Drain();
  EXPECT_EQ(budget_->reserved_bytes(), mesh_bytes_);
}

TEST_F(SessionRegistryTest, TooManySessionsAreRefused) {
  ServiceLimits limits;
  limits.max_sessions = 1;
  Restart(limits);
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> session, Create().get());
  EXPECT_THAT(Create().get(),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("--max-sessions")));
  ASSERT_THAT(Delete(session->id()), IsOk());
  EXPECT_THAT(Create().get(), IsOk());
}

TEST_F(SessionRegistryTest, AnIdleSessionMakesRoomForANewOne) {
  ServiceLimits limits;
  limits.max_sessions = 1;
  limits.session_idle_ttl = std::chrono::seconds(0);
  Restart(limits);
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> held, Create().get());
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> fresh, Create().get());
  EXPECT_THAT(registry_->table().Find(held->id()),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("idle")));
  Drain();
  EXPECT_EQ(budget_->reserved_bytes(), mesh_bytes_ + fresh->bytes_held());
}

TEST_F(SessionRegistryTest, IdleSessionsMakeRoomWhenMemoryIsShort) {
  ServiceLimits limits;
  limits.session_idle_ttl = std::chrono::seconds(0);
  Restart(limits);
  std::string first_id;
  {
    ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> first, Create().get());
    first_id = first->id();
  }
  Drain();  // the worker has let go of it
  const int64_t free_bytes = budget_->limit_bytes() - budget_->reserved_bytes();
  ASSERT_OK_AND_ASSIGN(const MemoryReservation all,
                       budget_->Reserve(free_bytes + 1, "all there is and one byte"));
  EXPECT_FALSE(registry_->table().Find(first_id).ok());
}

TEST_F(SessionRegistryTest, SessionsWithinTheirTtlStay) {
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> session, Create().get());
  EXPECT_EQ(registry_->sync().RemoveIdle(), 0);
  const int64_t free_bytes = budget_->limit_bytes() - budget_->reserved_bytes();
  EXPECT_THAT(budget_->Reserve(free_bytes + 1, "mesh"),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("mesh")));
  EXPECT_THAT(registry_->table().Find(session->id()), IsOk());
}

TEST_F(SessionRegistryTest, ASessionIsIdleFromTheEndOfItsTtlAndNotBefore) {
  std::string id;
  {
    ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> session, Create().get());
    id = session->id();
  }
  Drain();
  clock_.Advance(kTtl - kTick);
  EXPECT_EQ(registry_->sync().RemoveIdle(), 0) << "just before";
  clock_.Advance(kTick);
  EXPECT_EQ(registry_->sync().RemoveIdle(), 1) << "just after";
  EXPECT_THAT(registry_->table().Find(id),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("idle")));
  EXPECT_EQ(budget_->reserved_bytes(), mesh_bytes_);
}

TEST_F(SessionRegistryTest, FindingASessionKeepsItFromExpiring) {
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> session, Create().get());
  clock_.Advance(kTtl - kTick);
  EXPECT_THAT(registry_->table().Find(session->id()), IsOk());
  clock_.Advance(kTtl - kTick);
  EXPECT_EQ(registry_->sync().RemoveIdle(), 0);
  clock_.Advance(kTick);
  EXPECT_EQ(registry_->sync().RemoveIdle(), 1);
}

TEST_F(SessionRegistryTest, AClientMayChooseTheId) {
  const std::string id = "my-session-of-2026-11-22";
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> session, Create({"", "", id}).get());
  EXPECT_EQ(session->id(), id);
  EXPECT_THAT(registry_->table().Find(id), IsOk());
  EXPECT_THAT(Create({"", "", id}).get(),
              StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("session_id")));
  ASSERT_THAT(Delete(id), IsOk());
  EXPECT_THAT(Create({"", "", id}).get(), IsOk()) << "free again";
}

TEST_F(SessionRegistryTest, AChosenIdIsTakenFromTheFirstCallOn) {
  std::promise<void> go;
  pool_->Post(Lane::kBatch, [&go] { go.get_future().wait(); });
  std::future<CreateResult> first = Create({"", "", "chosen"});
  std::future<CreateResult> second = Create({"", "", "chosen"});
  EXPECT_THAT(second.get(), StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("chosen")));
  go.set_value();
  EXPECT_THAT(first.get(), IsOk());
}

TEST_F(SessionRegistryTest, AnIdUnderDeletionIsNeitherThereNorFreeAndTheMessageSaysSo) {
  ASSERT_THAT(Create({"", "", "chosen"}).get(), IsOk());
  std::promise<void> go;
  pool_->Post(Lane::kSolves, [&go] { go.get_future().wait(); });
  std::promise<absl::Status> deleted;
  registry_->sync().Delete("chosen",
                           [&](absl::Status status) { deleted.set_value(std::move(status)); });
  EXPECT_THAT(Create({"", "", "chosen"}).get(),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("being deleted")));
  go.set_value();
  EXPECT_THAT(deleted.get_future().get(), IsOk());
  EXPECT_THAT(Create({"", "", "chosen"}).get(), IsOk());
}

TEST_F(SessionRegistryTest, LateAbandonDoesNotAffectTheNextSessionOfTheId) {
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> first, Create({"", "", "chosen"}).get());
  ASSERT_THAT(Delete("chosen"), IsOk());
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> second, Create({"", "", "chosen"}).get());
  registry_->sync().Abandon(first);
  Drain();
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> found, registry_->table().Find("chosen"));
  EXPECT_EQ(found, second);
  EXPECT_THAT(Stored(), ::testing::ElementsAre("chosen"));
}

TEST_F(SessionRegistryTest, TheSameRequestWithTheSameChosenIdIsRepeatedSafely) {
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> first,
                       Create({"id", "print", "chosen"}).get());
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> again,
                       Create({"id", "print", "chosen"}).get());
  EXPECT_EQ(first, again);
}

TEST_F(SessionRegistryTest, TheStoreHoldsTheRecordsOfTheSessionsThatLive) {
  EXPECT_THAT(Stored(), ::testing::IsEmpty());
  ASSERT_THAT(Create({"", "", "a"}).get(), IsOk());
  ASSERT_THAT(Create({"", "", "b"}).get(), IsOk());
  EXPECT_THAT(Stored(), ::testing::ElementsAre("a", "b"));
  store_.Get("a", [this](const absl::StatusOr<SessionRecord>& stored) {
    ASSERT_THAT(stored, IsOk());
    SessionRecord expected = BarRecord(*bar_);
    expected.id = "a";
    EXPECT_EQ(stored->node_order.size(), static_cast<size_t>(bar_->mesh.num_vertices()));
    expected.node_order = stored->node_order;
    EXPECT_EQ(SerializeRecord(*stored), SerializeRecord(expected));
  });
  ASSERT_THAT(Delete("a"), IsOk());
  EXPECT_THAT(Stored(), ::testing::ElementsAre("b"));
  Drain();
  clock_.Advance(kTtl);
  EXPECT_EQ(registry_->sync().RemoveIdle(), 1);
  EXPECT_THAT(Stored(), ::testing::IsEmpty());
}

TEST_F(SessionRegistryTest, FailedOrAbandonedCreationLeavesNoRecord) {
  const auto cancelled = std::make_shared<std::atomic<bool>>(true);
  EXPECT_FALSE(Create({}, cancelled).get().ok());
  EXPECT_THAT(Stored(), ::testing::IsEmpty());
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> session, Create().get());
  registry_->sync().Abandon(session);
  Drain();
  EXPECT_THAT(Stored(), ::testing::IsEmpty());
}

TEST_F(SessionRegistryTest, AnIdThatTheStoreHasAlreadyIsRefusedAndLeavesNothing) {
  SessionRecord record = BarRecord(*bar_);
  record.id = "chosen";
  store_.Create(record, 1,
                [](const absl::StatusOr<SessionRecord>& stored) { EXPECT_THAT(stored, IsOk()); });
  EXPECT_THAT(Create({"", "", "chosen"}).get(),
              StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("chosen")));
  Drain();
  EXPECT_EQ(registry_->table().size(), 0);
  EXPECT_EQ(budget_->reserved_bytes(), mesh_bytes_);
  EXPECT_THAT(Stored(), ::testing::ElementsAre("chosen"));
}

}  // namespace
}  // namespace tissueform
