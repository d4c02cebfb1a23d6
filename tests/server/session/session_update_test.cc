// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// Sessions that are updated (server/session/session_registry.h).

#include <atomic>
#include <chrono>
#include <functional>
#include <future>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/error_reason.h"
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
using Updated = absl::StatusOr<SessionView>;

// Lets a test do something in the middle of a write.
class WatchedStore : public InMemorySessionStore {
 public:
  void Get(const std::string& id, RecordCallback done) override {
    ++reads;
    InMemorySessionStore::Get(id, std::move(done));
  }
  void Update(SessionRecord record, int64_t epoch, RecordCallback done) override {
    if (before_update) before_update();
    InMemorySessionStore::Update(std::move(record), epoch, std::move(done));
  }
  void CommitPoses(const std::string& id, std::vector<HandlePose> poses, int64_t epoch,
                   StatusCallback done) override {
    if (before_commit) std::exchange(before_commit, nullptr)();
    InMemorySessionStore::CommitPoses(id, std::move(poses), epoch, std::move(done));
  }

  std::atomic<int> reads = 0;
  std::function<void()> before_update;
  std::function<void()> before_commit;
};

class SessionUpdateTest : public ::testing::Test {
 protected:
  SessionUpdateTest() {
    bar_ = Store(SampleMesh(Bar({2, 2, 3})), &catalog_);
    mesh_bytes_ = budget_.reserved_bytes();
    SessionRecord record = BarRecord(*bar_);
    record.id = "a";
    std::promise<Opened> made;
    registry_.loader().Create(std::move(record), bar_, std::make_shared<std::atomic<bool>>(),
                              [&made](Opened session) { made.set_value(std::move(session)); });
    first_ = made.get_future().get().value();
  }
  ~SessionUpdateTest() override { pool_.reset(); }

  std::shared_ptr<Session> Open() {
    std::promise<Opened> opened;
    registry_.loader().Open("a", std::make_shared<std::atomic<bool>>(),
                            [&opened](Opened session) { opened.set_value(std::move(session)); });
    Opened session = opened.get_future().get();
    EXPECT_THAT(session, IsOk());
    return session.value_or(nullptr);
  }

  SessionRecord Record() {
    absl::StatusOr<SessionRecord> result;
    store_.Get("a", [&result](absl::StatusOr<SessionRecord> got) { result = std::move(got); });
    return result.value();
  }

  std::future<Updated> Update(
      const std::string& etag, std::function<void(SessionRecord*)> change,
      SessionLoader::CancelFlag cancelled = std::make_shared<std::atomic<bool>>()) {
    auto promise = std::make_shared<std::promise<Updated>>();
    registry_.loader().Update(
        "a", etag,
        [change = std::move(change)](SessionRecord record, const StoredMesh& /*mesh*/) {
          change(&record);
          return absl::StatusOr<SessionRecord>(std::move(record));
        },
        std::move(cancelled), [promise](Updated view) { promise->set_value(std::move(view)); });
    return promise->get_future();
  }

  std::future<absl::Status> StartCommit(const std::shared_ptr<Session>& session,
                                        const HandlePose& pose) {
    auto done = std::make_shared<std::promise<absl::Status>>();
    registry_.sync().CommitPoses(
        session, {pose}, [done](absl::Status status) { done->set_value(std::move(status)); });
    return done->get_future();
  }
  absl::Status Commit(const std::shared_ptr<Session>& session, const HandlePose& pose) {
    return StartCommit(session, pose).get();
  }

  static void Soften(SessionRecord* record) { record->stiffness = 500.0; }
  static void Rename(SessionRecord* record) { record->handles[0].name = "crown"; }
  static HandlePose Moved(double x) {
    HandlePose pose;
    pose.translation_mm = {x, 2, 3};
    return pose;
  }

  FakeClock clock_;
  ServiceLimits limits_;
  MemoryBudget budget_{64 << 20};
  MeshCatalog catalog_{limits_, &budget_, nullptr, &clock_};
  WatchedStore store_;
  std::unique_ptr<WorkerPool> pool_ = std::make_unique<WorkerPool>(1);
  SessionRegistry registry_{limits_, &budget_, pool_.get(), &store_, &catalog_, &clock_};
  std::shared_ptr<const StoredMesh> bar_;
  std::shared_ptr<Session> first_;
  int64_t mesh_bytes_ = 0;
};

TEST_F(SessionUpdateTest, KeepsTheNameAndAppliesTheRequestedChange) {
  const SessionRecord before = Record();
  ASSERT_OK_AND_ASSIGN(const SessionView view, Update(before.etag, [](SessionRecord* record) {
                                                 record->model = DeformationModel::kLinearElastic;
                                               }).get());
  EXPECT_EQ(view.session->model(), DeformationModel::kLinearElastic);
  EXPECT_EQ(view.session, Open());
  EXPECT_EQ(Record().model, DeformationModel::kLinearElastic);
  EXPECT_EQ(Record().etag, view.record.etag);
  EXPECT_NE(view.record.etag, before.etag);
  EXPECT_EQ(Record().created_s, before.created_s);
  // The old one notifies its holders to open the session again.
  EXPECT_TRUE(first_->evicted());
  EXPECT_TRUE(first_->updated());
  EXPECT_FALSE(first_->outdated());
  EXPECT_TRUE(HasReason(first_->Solve(first_->model(), {HandlePose()}, {}).status(),
                        ErrorReason::kSessionUpdated));
  EXPECT_EQ(budget_.reserved_bytes(), mesh_bytes_ + view.session->bytes_held());
}

TEST_F(SessionUpdateTest, AnOldEtagIsRefusedBeforeAnythingIsMade) {
  const std::string etag = Record().etag;
  ASSERT_THAT(Update(etag, Soften).get(), IsOk());
  const std::shared_ptr<Session> second = Open();
  const Updated stale = Update(etag, Rename).get();
  EXPECT_THAT(stale, StatusIs(absl::StatusCode::kAborted));
  EXPECT_TRUE(HasReason(stale.status(), ErrorReason::kStaleEtag));
  EXPECT_EQ(Open(), second);
  EXPECT_FALSE(second->updated());
  EXPECT_THAT(Update("", Rename).get(), IsOk()) << "whatever it is";
}

TEST_F(SessionUpdateTest, OneOfTwoConcurrentUpdatesIsKept) {
  const std::string etag = Record().etag;
  std::promise<void> go;
  pool_->Post(Lane::kBatch, [&go] { go.get_future().wait(); });
  std::future<Updated> one = Update(etag, Soften);
  std::future<Updated> other =
      Update(etag, [](SessionRecord* record) { record->stiffness = 700.0; });
  go.set_value();
  const Updated first = one.get();
  const Updated second = other.get();
  EXPECT_NE(first.ok(), second.ok());
  const Updated& kept = first.ok() ? first : second;
  EXPECT_TRUE(HasReason((first.ok() ? second : first).status(), ErrorReason::kStaleEtag));
  EXPECT_EQ(Record().stiffness, kept->record.stiffness);
  EXPECT_EQ(Open(), kept->session);
}

TEST_F(SessionUpdateTest, AFailedUpdateLeavesTheSessionUnchanged) {
  const SessionRecord before = Record();
  const int64_t bytes = budget_.reserved_bytes();
  EXPECT_THAT(Update("", [](SessionRecord* record) { record->stiffness = -1.0; }).get(),
              StatusIs(absl::StatusCode::kInvalidArgument));
  EXPECT_EQ(Record().etag, before.etag);
  EXPECT_EQ(Open(), first_);
  EXPECT_THAT(first_->Solve(first_->model(), {HandlePose()}, {}), IsOk());
  EXPECT_EQ(budget_.reserved_bytes(), bytes);
}

TEST_F(SessionUpdateTest, CancelledUpdateLeavesTheSessionUnchanged) {
  const std::string etag = Record().etag;
  std::promise<void> go;
  pool_->Post(Lane::kBatch, [&go] { go.get_future().wait(); });
  const auto cancelled = std::make_shared<std::atomic<bool>>(false);
  std::future<Updated> updated = Update("", Soften, cancelled);
  *cancelled = true;
  go.set_value();
  EXPECT_THAT(updated.get(), StatusIs(absl::StatusCode::kCancelled));
  EXPECT_EQ(Record().etag, etag);
  EXPECT_EQ(Open(), first_);
}

TEST_F(SessionUpdateTest, PosesThatAreCommittedWhileItIsPreparedAreKept) {
  std::promise<void> go;
  pool_->Post(Lane::kBatch, [&go] { go.get_future().wait(); });
  std::future<Updated> updated = Update("", Soften);
  EXPECT_THAT(Commit(first_, Moved(7)), IsOk());
  go.set_value();
  ASSERT_OK_AND_ASSIGN(const SessionView view, updated.get());
  ASSERT_EQ(view.record.last_poses.size(), 1U);
  EXPECT_EQ(view.record.last_poses[0].translation_mm.x(), 7);
  // A stream that has not noticed yet; its poses still fit.
  EXPECT_THAT(Commit(first_, Moved(8)), IsOk());
  EXPECT_EQ(Record().last_poses[0].translation_mm.x(), 8);
}

TEST_F(SessionUpdateTest, AnUpdateDoesNotReadBeforeTheStoreHasACommitThatCameFirst) {
  std::future<Updated> updated;
  store_.before_commit = [&] {
    updated = Update("", Soften);
    // The update has read the record, to change it. If it did not wait for this commit, it would
    // read it once more well within this time; a slow machine does not fail the test.
    const int reads = store_.reads;
    EXPECT_EQ(updated.wait_for(std::chrono::milliseconds(100)), std::future_status::timeout);
    EXPECT_EQ(store_.reads, reads);
  };
  EXPECT_THAT(Commit(first_, Moved(7)), IsOk());
  ASSERT_OK_AND_ASSIGN(const SessionView view, updated.get());
  ASSERT_EQ(view.record.last_poses.size(), 1U);
  EXPECT_EQ(view.record.last_poses[0].translation_mm.x(), 7);
}

TEST_F(SessionUpdateTest, ACommitInTheMiddleOfAnUpdateComesAfterIt) {
  std::future<absl::Status> committed;
  store_.before_update = [&] {
    committed = StartCommit(first_, Moved(7));
    EXPECT_EQ(committed.wait_for(std::chrono::seconds(0)), std::future_status::timeout);
  };
  ASSERT_THAT(Update("", Soften).get(), IsOk());
  EXPECT_THAT(committed.get(), IsOk());
  ASSERT_EQ(Record().last_poses.size(), 1U);
  EXPECT_EQ(Record().last_poses[0].translation_mm.x(), 7);
  ASSERT_THAT(Update("", Rename).get(), IsOk());
  EXPECT_TRUE(HasReason(committed.get(), ErrorReason::kSessionUpdated));
  EXPECT_TRUE(Record().last_poses.empty()) << "they are of handles that are gone";
}

TEST_F(SessionUpdateTest, OtherHandlesBeginAtRestAndTakeNoPosesOfTheOldOnes) {
  ASSERT_THAT(Commit(first_, Moved(7)), IsOk());
  ASSERT_THAT(Update("", Rename).get(), IsOk());
  EXPECT_TRUE(Record().last_poses.empty());
  EXPECT_TRUE(first_->outdated());
  const absl::Status refused = Commit(first_, Moved(8));
  EXPECT_TRUE(HasReason(refused, ErrorReason::kSessionUpdated)) << refused;
  EXPECT_TRUE(Record().last_poses.empty());
  EXPECT_THAT(Commit(Open(), Moved(9)), IsOk());
}

TEST_F(SessionUpdateTest, HoldersOfAnEvictedSessionLearnOfTheUpdate) {
  clock_.Advance(2 * SessionTable::kInUse);
  ASSERT_EQ(registry_.table().Evict([] { return false; }), 1);
  EXPECT_FALSE(first_->updated());
  ASSERT_THAT(Update("", Soften).get(), IsOk());
  EXPECT_TRUE(first_->updated());
  EXPECT_EQ(registry_.table().size(), 1);
}

TEST_F(SessionUpdateTest, OpenStartedBeforeAnUpdateGetsTheUpdatedSession) {
  clock_.Advance(2 * SessionTable::kInUse);
  ASSERT_EQ(registry_.table().Evict([] { return false; }), 1);
  std::promise<void> go;
  pool_->Post(Lane::kBatch, [&go] { go.get_future().wait(); });
  // In this order on the worker: the update's work, then the restore of the record before it.
  std::future<Updated> updated = Update("", Soften);
  std::promise<void> asked;
  pool_->Post(Lane::kStore, [&asked] { asked.set_value(); });
  asked.get_future().wait();
  std::promise<Opened> opened;
  registry_.loader().Open("a", std::make_shared<std::atomic<bool>>(),
                          [&opened](Opened session) { opened.set_value(std::move(session)); });
  std::promise<void> read;
  pool_->Post(Lane::kStore, [&read] { read.set_value(); });
  read.get_future().wait();
  go.set_value();
  ASSERT_OK_AND_ASSIGN(const SessionView view, updated.get());
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> session, opened.get_future().get());
  EXPECT_EQ(session, view.session);
  EXPECT_EQ(budget_.reserved_bytes(), mesh_bytes_ + session->bytes_held());
}

TEST_F(SessionUpdateTest, ASessionDeletedDuringAnUpdateStaysDeleted) {
  std::promise<void> go;
  pool_->Post(Lane::kBatch, [&go] { go.get_future().wait(); });
  std::future<Updated> updated = Update("", Soften);
  std::promise<absl::Status> deleted;
  registry_.sync().Delete("a", [&](absl::Status status) { deleted.set_value(std::move(status)); });
  EXPECT_THAT(deleted.get_future().get(), IsOk());
  go.set_value();
  EXPECT_THAT(updated.get(), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_EQ(registry_.table().size(), 0);
  EXPECT_EQ(budget_.reserved_bytes(), mesh_bytes_);
}

}  // namespace
}  // namespace tissueform
