// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// Meshes that are deleted while sessions are made from them, read or uploaded: no record of a
// session may be left whose mesh is gone (server/session/session_registry.h, mesh_catalog.h).

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
using testing::Store;

using Made = absl::StatusOr<std::shared_ptr<Session>>;

MATCHER_P(Because, reason, std::string(ReasonName(reason))) {
  *result_listener << testing::GetStatus(arg).ToString();
  return HasReason(testing::GetStatus(arg), reason);
}

// Does something in the middle of a call.
class InterruptedMeshStore : public InMemoryMeshStore {
 public:
  absl::Status Put(const MeshRecord& record, const MeshPayloadView& payload) override {
    absl::Status status = InMemoryMeshStore::Put(record, payload);
    if (after_put) after_put();
    return status;
  }
  absl::StatusOr<MeshPayload> Read(const std::string& sha256) override {
    absl::StatusOr<MeshPayload> payload = InMemoryMeshStore::Read(sha256);
    if (after_read) after_read();
    return payload;
  }
  absl::Status Delete(const std::string& sha256) override {
    if (before_delete) before_delete();
    return InMemoryMeshStore::Delete(sha256);
  }

  std::function<void()> after_put;
  std::function<void()> after_read;
  std::function<void()> before_delete;
};

// Deletes a record only when it may.
class HeldSessionStore : public InMemorySessionStore {
 public:
  void Delete(const std::string& id, const std::string& etag, int64_t epoch,
              StatusCallback done) override {
    if (on_delete) on_delete();
    InMemorySessionStore::Delete(id, etag, epoch, std::move(done));
  }

  std::function<void()> on_delete;
};

class MeshRemovalTest : public ::testing::Test {
 protected:
  ~MeshRemovalTest() override { pool_.reset(); }

  std::future<Made> Create() {
    auto promise = std::make_shared<std::promise<Made>>();
    SessionRecord record = BarRecord(*bar_);
    record.id = "a";
    registry_.loader().Create(std::move(record), bar_, std::make_shared<std::atomic<bool>>(),
                              [promise](Made session) { promise->set_value(std::move(session)); });
    return promise->get_future();
  }
  std::future<absl::Status> Delete() {
    auto promise = std::make_shared<std::promise<absl::Status>>();
    registry_.sync().Delete(
        "a", [promise](absl::Status status) { promise->set_value(std::move(status)); });
    return promise->get_future();
  }
  absl::Status Remove() { return registry_.table().RemoveMesh(sha256_); }
  // On another thread.
  std::future<absl::Status> StartRemoving() {
    return std::async(std::launch::async, [this] { return catalog_.Remove(sha256_); });
  }
  // Where a removal could go on it would, well within this time; none of the tests fails without
  // reason when the machine is slow.
  static bool Waits(const std::future<absl::Status>& removal) {
    return removal.wait_for(std::chrono::milliseconds(50)) == std::future_status::timeout;
  }
  size_t NumRecords() {
    size_t count = 0;
    sessions_.List({}, [&count](const absl::StatusOr<SessionStore::Page>& page) {
      count = page->records.size();
    });
    return count;
  }

  const SampleMesh sample_{Bar({2, 2, 3})};
  const std::string sha256_ = sample_.Announcement().sha256;
  FakeClock clock_;
  ServiceLimits limits_;
  MemoryBudget budget_{64 << 20};
  InterruptedMeshStore meshes_;
  HeldSessionStore sessions_;
  MeshCatalog catalog_{limits_, &budget_, &meshes_, &clock_};
  std::shared_ptr<const StoredMesh> bar_ = Store(sample_, &catalog_);
  // One worker: where it is blocked nothing is made.
  std::unique_ptr<WorkerPool> pool_ = std::make_unique<WorkerPool>(1);
  SessionRegistry registry_{limits_, &budget_, pool_.get(), &sessions_, &catalog_, &clock_};
};

TEST_F(MeshRemovalTest, ASessionThatIsBeingMadeKeepsItsMesh) {
  std::promise<void> release;
  pool_->Post(Lane::kBatch, [released = release.get_future().share()] { released.wait(); });
  std::future<Made> session = Create();
  EXPECT_THAT(Remove(), Because(ErrorReason::kMeshInUse));
  release.set_value();
  EXPECT_THAT(session.get(), IsOk());
  EXPECT_THAT(Remove(), Because(ErrorReason::kMeshInUse));
  EXPECT_THAT(catalog_.Look(sha256_), IsOk());
  EXPECT_THAT(Delete().get(), IsOk());
  EXPECT_THAT(Remove(), IsOk());
  EXPECT_THAT(catalog_.Look(sha256_), Because(ErrorReason::kMeshNotFound));
}

TEST_F(MeshRemovalTest, NoSessionIsMadeOfAMeshThatWentAfterItWasFound) {
  ASSERT_THAT(Remove(), IsOk());
  EXPECT_THAT(Create().get(), Because(ErrorReason::kMeshNotFound));
  EXPECT_EQ(NumRecords(), 0U);
  bar_ = Store(sample_, &catalog_);
  EXPECT_THAT(Create().get(), IsOk());
}

TEST_F(MeshRemovalTest, NoSessionIsBegunWhileItsMeshGoes) {
  std::future<Made> session;
  meshes_.before_delete = [&] { session = Create(); };
  ASSERT_THAT(Remove(), IsOk());
  EXPECT_THAT(session.get(), Because(ErrorReason::kMeshNotFound));
  EXPECT_EQ(NumRecords(), 0U);
}

TEST_F(MeshRemovalTest, ASessionKeepsItsMeshUntilItsRecordIsGone) {
  ASSERT_THAT(Create().get(), IsOk());
  absl::Status meanwhile;
  sessions_.on_delete = [&] { meanwhile = Remove(); };
  EXPECT_THAT(Delete().get(), IsOk());
  EXPECT_THAT(meanwhile, Because(ErrorReason::kMeshInUse));
  EXPECT_THAT(Remove(), IsOk());
}

TEST_F(MeshRemovalTest, AMeshThatIsBeingReadIsRemovedAfterwards) {
  bar_.reset();
  ASSERT_EQ(catalog_.RemoveIdle(std::chrono::seconds(0)), 1);
  std::future<absl::Status> removal;
  meshes_.after_read = [&] {
    removal = StartRemoving();
    EXPECT_TRUE(Waits(removal));
  };
  EXPECT_THAT(catalog_.Load(sha256_), IsOk());
  EXPECT_THAT(removal.get(), IsOk());
  EXPECT_THAT(catalog_.Look(sha256_), Because(ErrorReason::kMeshNotFound));
}

TEST_F(MeshRemovalTest, AMeshThatArrivesIsRemovedAfterwards) {
  ASSERT_THAT(Remove(), IsOk());
  std::future<absl::Status> removal;
  meshes_.after_put = [&] {
    removal = StartRemoving();
    EXPECT_TRUE(Waits(removal));
  };
  Store(sample_, &catalog_);
  EXPECT_THAT(removal.get(), IsOk());
  EXPECT_THAT(catalog_.Look(sha256_), Because(ErrorReason::kMeshNotFound));
}

}  // namespace
}  // namespace tissueform
