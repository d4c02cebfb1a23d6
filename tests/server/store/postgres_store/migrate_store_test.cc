// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/migrate_store.h"

#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "server/exports/export_store.h"
#include "server/platform/storage/data_folder.h"
#include "server/store/access_queries.h"
#include "server/store/durable_store.h"
#include "server/store/postgres_store/postgres_session_leases.h"
#include "server/store/sql_access_store.h"
#include "tests/server/store/postgres_store/test_database.h"
#include "tests/server/store/store_samples.h"
#include "tests/server/store/stores_case.h"
#include "tests/server/store/waiting_calls.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

class MigrateStoreTest : public ::testing::Test {
 protected:
  void SetUp() override {
    TF_SKIP_WITHOUT_DATABASE();
    EmptyTestDatabase();
    from_ = *DurableStore::Open(*DataFolder::Open(folder_ / "data"), {.clock = [] { return 777; }});
    to_ = *PostgresStores::Open({.database = TestDatabaseOptions()});
  }

  const ScratchFolder folder_;
  std::unique_ptr<DurableStore> from_;
  std::unique_ptr<PostgresStores> to_;
};

TEST_F(MigrateStoreTest, CopiesAllDataUnchanged) {
  constexpr int kSessions = 103;  // more than a page
  for (int i = 0; i < kSessions; ++i) {
    ASSERT_THAT(CreateSession(from_->sessions(), SampleSession(absl::StrCat("s", i), i), 3),
                IsOk());
  }
  ASSERT_THAT(CommitPoses(from_->sessions(), "s7", SamplePoses(9), 4), IsOk());
  const MeshPayload mesh = SamplePayload(1);
  ASSERT_THAT(from_->meshes().Put(RecordOf(mesh), mesh.View()), IsOk());
  ASSERT_THAT(from_->predictions().Create(SamplePrediction("p"), SamplePositions(1)), IsOk());
  const std::string file = SampleCase(1, 2'000'000);
  CaseRecord mine = CaseRecordOf(file);
  ASSERT_THAT(KeepCase(from_->cases(), mine, file), IsOk());
  CaseRecord theirs = mine;
  theirs.owner = "another";
  ASSERT_THAT(KeepCase(from_->cases(), theirs, file), IsOk());
  const MeshRight right = {.principal = "ann", .sha256 = RecordOf(mesh).sha256, .bytes = 12};
  ASSERT_THAT(SqlAccessStore(&from_->database()).PutMeshRight(right), IsOk());
  ASSERT_THAT(SqlExportStore(&from_->database()).Put({.id = "e", .prediction = "p"}), IsOk());

  ASSERT_OK_AND_ASSIGN(const MigrationSummary summary, MigrateStore(from_.get(), to_.get()));
  EXPECT_EQ(summary.sessions, kSessions);
  EXPECT_EQ(summary.cases, 2);
  for (int i = 0; i < kSessions; ++i) {
    const std::string id = absl::StrCat("s", i);
    ASSERT_OK_AND_ASSIGN(const SessionRecord before, GetSession(from_->sessions(), id));
    ASSERT_OK_AND_ASSIGN(const SessionRecord after, GetSession(to_->sessions(), id));
    EXPECT_EQ(SerializeRecord(after), SerializeRecord(before));
    EXPECT_EQ(SerializePoses(after.last_poses), SerializePoses(before.last_poses));
    EXPECT_EQ(after.etag, before.etag);
    EXPECT_EQ(after.epoch, before.epoch);
    EXPECT_EQ(after.created_s, 777);
    EXPECT_EQ(after.last_used_s, 777);
  }
  PostgresSessionLeases leases(to_->pool(), "A");
  ASSERT_OK_AND_ASSIGN(const LeaseAnswer taken, leases.Acquire("s7"));
  EXPECT_GT(taken.lease.epoch, 4) << "whoever takes one has a greater epoch than all before";
  ASSERT_OK_AND_ASSIGN(const MeshPayload payload, to_->meshes().Read(RecordOf(mesh).sha256));
  EXPECT_EQ(payload.View().segments, mesh.View().segments);
  ASSERT_OK_AND_ASSIGN(const std::string positions, to_->predictions().Positions("p"));
  EXPECT_EQ(positions, SamplePositions(1));
  ASSERT_OK_AND_ASSIGN(const CaseStore::Page cases, to_->cases().List({}));
  EXPECT_THAT(cases.records, SizeIs(2));
  ASSERT_OK_AND_ASSIGN(const std::string read, ReadWholeCase(to_->cases(), mine.sha256));
  EXPECT_EQ(read, file);
  AccessQueries access(&to_->database());
  EXPECT_THAT(access.FindMeshUse(right.sha256)->senders, ElementsAre("ann"));
  EXPECT_EQ(access.HoldingsOf("ann")->bytes, 12);
  EXPECT_THAT(*SqlExportStore(&to_->database()).Load(), SizeIs(1));
}

TEST_F(MigrateStoreTest, AStoreThatHoldsSomethingIsLeftAlone) {
  ASSERT_THAT(CreateSession(from_->sessions(), SampleSession("a", 1)), IsOk());
  to_ = OpenTestStores();
  ASSERT_THAT(CreateSession(to_->sessions(), SampleSession("b", 1)), IsOk());
  EXPECT_THAT(MigrateStore(from_.get(), to_.get()),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("not empty"), HasSubstr("sessions"))));
  EXPECT_THAT(GetSession(to_->sessions(), "a"), StatusIs(absl::StatusCode::kNotFound));
}

}  // namespace
}  // namespace tissueform::testing
