// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/change_listener.h"

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "server/exports/export_store.h"
#include "server/store/sql_access_store.h"
#include "tests/server/store/postgres_store/test_database.h"
#include "tests/server/store/store_samples.h"
#include "tests/server/store/waiting_calls.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::Contains;
using Kind = StoreChange::Kind;

TEST(StoreChangeTest, AnUnknownNoticeMeansThatAnythingMayHaveChanged) {
  EXPECT_EQ(ParseStoreChange("session_deleted a b"),
            (StoreChange{.kind = Kind::kSessionDeleted, .name = "a b"}));
  EXPECT_EQ(ParseStoreChange("exports_changed "), (StoreChange{.kind = Kind::kExportsChanged}));
  for (const char* other : {"", "session_deleted", "fresh_thing x", "access_changed ", " "}) {
    EXPECT_EQ(ParseStoreChange(other), (StoreChange{.kind = Kind::kMissed})) << other;
  }
}

class ChangeListenerTest : public ::testing::Test {
 protected:
  void SetUp() override {
    TF_SKIP_WITHOUT_DATABASE();
    EmptyTestDatabase();
    stores_ = OpenTestStores();
    listener_ = *ChangeListener::Start(TestDatabaseOptions(), [this](const StoreChange& change) {
      MutexLock lock(mutex_);
      seen_.push_back(change);
      changed_.NotifyAll();
    });
  }
  void TearDown() override { listener_.reset(); }

  // All changes that have been reported once this one is.
  std::vector<StoreChange> SeenUntil(const StoreChange& last) {
    MutexLock lock(mutex_);
    while (std::find(seen_.begin(), seen_.end(), last) == seen_.end()) changed_.Wait(mutex_);
    return seen_;
  }

  Mutex mutex_;
  ConditionVariable changed_;
  std::vector<StoreChange> seen_ ABSL_GUARDED_BY(mutex_);
  std::unique_ptr<PostgresStores> stores_;
  std::unique_ptr<ChangeListener> listener_;
};

TEST_F(ChangeListenerTest, ReportsOnlyRelevantChangesInOrder) {
  ASSERT_OK_AND_ASSIGN(const SessionRecord record,
                       CreateSession(stores_->sessions(), SampleSession("s", 1)));
  ASSERT_THAT(UpdateSession(stores_->sessions(), record), IsOk());
  ASSERT_THAT(CommitPoses(stores_->sessions(), "s", SamplePoses(1)), IsOk());
  SqlAccessStore access(&stores_->database());
  ASSERT_THAT(access.PutMeshRight({.principal = "ann", .sha256 = "e"}), IsOk());
  ASSERT_THAT(access.PutLink({.digest = "d", .session = "s"}, /*now_s=*/-1, /*most=*/1), IsOk());
  ASSERT_THAT(access.PutShare({.resource = "projects/p", .owner = "ann", .principal = "bob"}, 1),
              IsOk());
  ASSERT_THAT(SqlExportStore(&stores_->database()).Put({.id = "e", .prediction = "p"}), IsOk());
  const std::string mesh = record.mesh_sha256;
  ASSERT_THAT(stores_->predictions().Create(SamplePrediction("p"), SamplePositions(1)), IsOk());
  ASSERT_THAT(stores_->predictions().Delete("p"), IsOk());
  const std::string file = SampleCase(1, 1'000);
  CaseRecord of_ann = CaseRecordOf(file);
  of_ann.owner = "ann lee";
  ASSERT_THAT(KeepCase(stores_->cases(), of_ann, file), IsOk());
  ASSERT_THAT(stores_->cases().Delete(of_ann.key()), IsOk());
  ASSERT_THAT(DeleteSession(stores_->sessions(), "s"), IsOk());
  ASSERT_THAT(stores_->meshes().Delete(mesh), IsOk());
  const StoreChange last = {.kind = Kind::kMeshDeleted, .name = mesh};
  const std::vector<StoreChange> expected = {{.kind = Kind::kSessionCreated, .name = "s"},
                                             {.kind = Kind::kSessionChanged, .name = "s"},
                                             {.kind = Kind::kExportsChanged},
                                             {.kind = Kind::kSessionDeleted, .name = "s"},
                                             last};
  EXPECT_EQ(SeenUntil(last), expected);
}

TEST_F(ChangeListenerTest, ReportsMissedChangesAfterACutAndListensAgain) {
  RunSql(
      "SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity WHERE application_name = "
      "'tissueform-server' AND pid <> pg_backend_pid()");
  EXPECT_THAT(SeenUntil({.kind = Kind::kMissed}), Contains(StoreChange{.kind = Kind::kMissed}));
  ASSERT_THAT(CreateSession(stores_->sessions(), SampleSession("t", 1)), IsOk());
  ASSERT_THAT(DeleteSession(stores_->sessions(), "t"), IsOk());
  SeenUntil({.kind = Kind::kSessionDeleted, .name = "t"});
}

}  // namespace
}  // namespace tissueform::testing
