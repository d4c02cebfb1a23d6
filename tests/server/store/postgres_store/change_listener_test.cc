// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/change_listener.h"

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "server/store/sql_access_store.h"
#include "tests/server/store/postgres_store/test_database.h"
#include "tests/server/store/store_samples.h"
#include "tests/server/store/waiting_calls.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::Contains;
using Kind = StoreChange::Kind;

TEST(StoreChangeTest, WhatIsNotKnownMeansThatAnythingMayHaveChanged) {
  EXPECT_EQ(ParseStoreChange("session_deleted a b"),
            (StoreChange{.kind = Kind::kSessionDeleted, .name = "a b"}));
  EXPECT_EQ(ParseStoreChange("case_deleted 1a2b ann lee"),
            (StoreChange{.kind = Kind::kCaseDeleted, .name = "1a2b", .owner = "ann lee"}));
  EXPECT_EQ(ParseStoreChange("access_changed "), (StoreChange{.kind = Kind::kAccessChanged}));
  for (const char* other : {"", "session_deleted", "fresh_thing x", "case_created 1a", " "}) {
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

  // All that has been told when this is.
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

TEST_F(ChangeListenerTest, WhatOthersMustKnowIsToldInOrderAndPosesAreNot) {
  ASSERT_OK_AND_ASSIGN(const SessionRecord record,
                       CreateSession(stores_->sessions(), SampleSession("s", 1)));
  ASSERT_THAT(UpdateSession(stores_->sessions(), record), IsOk());
  ASSERT_THAT(CommitPoses(stores_->sessions(), "s", SamplePoses(1)), IsOk());
  SqlAccessStore access(&stores_->database());
  ASSERT_THAT(WaitFor<absl::Status>([&](auto done) {
                access.Change({}, {.mesh_rights = {{.principal = "ann", .sha256 = "e"}}}, done);
              }),
              IsOk());
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
  const std::vector<StoreChange> expected = {
      {.kind = Kind::kSessionCreated, .name = "s"},
      {.kind = Kind::kSessionChanged, .name = "s"},
      {.kind = Kind::kAccessChanged},
      {.kind = Kind::kPredictionCreated, .name = "p"},
      {.kind = Kind::kPredictionDeleted, .name = "p"},
      {.kind = Kind::kCaseCreated, .name = of_ann.sha256, .owner = "ann lee"},
      {.kind = Kind::kCaseDeleted, .name = of_ann.sha256, .owner = "ann lee"},
      {.kind = Kind::kSessionDeleted, .name = "s"},
      last};
  EXPECT_EQ(SeenUntil(last), expected);
}

TEST_F(ChangeListenerTest, WhoWasCutOffIsToldThatAnythingMayHaveChangedAndListensAgain) {
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
