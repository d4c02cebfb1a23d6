// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/postgres_stores.h"

#include <chrono>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/error_reason.h"
#include "server/exports/export_queue.h"
#include "server/exports/export_store.h"
#include "server/store/access_queries.h"
#include "server/store/postgres_store/postgres_blobs.h"
#include "server/store/postgres_store/postgres_schema.h"
#include "server/store/sql_access_store.h"
#include "server/store/store_errors.h"
#include "tests/server/store/postgres_store/test_database.h"
#include "tests/server/store/store_samples.h"
#include "tests/server/store/waiting_calls.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::ElementsAre;
using ::testing::Ge;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Lt;
using ::testing::Not;
using Code = absl::StatusCode;

class PostgresStoresTest : public ::testing::Test {
 protected:
  void SetUp() override {
    TF_SKIP_WITHOUT_DATABASE();
    EmptyTestDatabase();
    stores_ = OpenTestStores();
  }

  static int64_t Count(const std::string& what) {
    return RunSql(absl::StrCat("SELECT count(*) FROM ", what)).Integer(0, 0);
  }
  // One mesh, of several pieces when it is asked for.
  std::string PutMesh(int number, int num_vertices = 50) {
    const MeshPayload payload = SamplePayload(number, num_vertices);
    const MeshRecord record = RecordOf(payload);
    EXPECT_THAT(stores_->meshes().Put(record, payload.View()), IsOk());
    return record.sha256;
  }

  // A database of its own, made again, that an administrator may take away.
  static void MakeAway() {
    RunOutsideTransaction("DROP DATABASE IF EXISTS away WITH (FORCE)");
    RunOutsideTransaction("CREATE DATABASE away");
  }
  static std::unique_ptr<PostgresStores> OpenAway(std::chrono::milliseconds patience) {
    PostgresOptions options = TestDatabaseOptions("away");
    options.patience = patience;
    return OpenTestStores(SystemUnixSeconds, options);
  }

  std::unique_ptr<PostgresStores> stores_;
};

TEST_F(PostgresStoresTest, OneServerFindsTheRecordsOfAnother) {
  const auto other = OpenTestStores();
  ASSERT_OK_AND_ASSIGN(const SessionRecord made,
                       CreateSession(stores_->sessions(), SampleSession("s", 1)));
  ASSERT_THAT(CommitPoses(stores_->sessions(), "s", SamplePoses(2)), IsOk());
  ASSERT_OK_AND_ASSIGN(const SessionRecord found, GetSession(other->sessions(), "s"));
  EXPECT_EQ(found.etag, made.etag);
  EXPECT_EQ(SerializePoses(found.last_poses), SerializePoses(SamplePoses(2)));
  const std::string mesh = PutMesh(1);
  ASSERT_OK_AND_ASSIGN(const MeshPayload payload, other->meshes().Read(mesh));
  EXPECT_EQ(payload.View().Sha256(), mesh);
}

TEST_F(PostgresStoresTest, TheDatabasesClockDatesRecords) {
  const auto set_year = [](const char* year) {
    RunSql(absl::StrCat(
        "CREATE OR REPLACE FUNCTION tissueform_now() RETURNS timestamptz VOLATILE LANGUAGE sql AS "
        "'SELECT timestamptz ''",
        year, "-02-03 00:00:00Z''';"));
  };
  const auto soon_after = [](int64_t then) { return AllOf(Ge(then), Lt(then + 3600)); };
  constexpr int64_t kThen = 981'158'400;
  set_year("2001");
  ASSERT_OK_AND_ASSIGN(const auto stores,
                       PostgresStores::Open({.database = TestDatabaseOptions()}));
  EXPECT_THAT(stores->NowS(), soon_after(kThen));
  ASSERT_OK_AND_ASSIGN(const SessionRecord made,
                       CreateSession(stores->sessions(), SampleSession("s", 1)));
  EXPECT_THAT(made.created_s, soon_after(kThen));
  set_year("2002");
  ASSERT_THAT(stores->AskTime(), IsOk());
  EXPECT_THAT(stores->NowS(), soon_after(kThen + 365 * 24 * 3600));
}

TEST_F(PostgresStoresTest, ALargeBlobIsManyRowsAndIsReadAsItWas) {
  const std::string mesh = PutMesh(1, 100'000);
  EXPECT_GT(Count("blob_pieces"), 2);
  EXPECT_EQ(Count(absl::StrCat("blob_pieces WHERE length(bytes) > ", PostgresBlobs::kPieceBytes)),
            0);
  ASSERT_OK_AND_ASSIGN(const MeshPayload payload, stores_->meshes().Read(mesh));
  EXPECT_EQ(payload.View().Sha256(), mesh);
  ASSERT_THAT(stores_->meshes().Delete(mesh), IsOk());
  EXPECT_EQ(Count("blobs"), 1) << "that of sample sessions";
  EXPECT_EQ(Count("blob_pieces"), 1);
}

TEST_F(PostgresStoresTest, PiecesThatAreMissingAreWrittenWhenItsBlobComesAgain) {
  const std::string mesh = PutMesh(1, 100'000);
  RunSql("DELETE FROM blob_pieces WHERE number = 1;");
  EXPECT_EQ(PutMesh(1, 100'000), mesh);
  EXPECT_THAT(stores_->meshes().Read(mesh), IsOk());
}

struct Damage {
  const char* name;
  const char* sql;
};

class PostgresDamageTest : public PostgresStoresTest,
                           public ::testing::WithParamInterface<Damage> {};

TEST_P(PostgresDamageTest, ADamagedBlobIsReportedOnceSetAsideAndReplaceable) {
  const std::string mesh = PutMesh(1, 100'000);
  const std::string positions = SamplePositions(1, 200'000);
  ASSERT_THAT(
      stores_->predictions().Create(SamplePrediction("p", "planner", "s", 200'000), positions),
      IsOk());
  const std::string bytes = SampleCase(1, 3'000'000);
  const CaseRecord record = CaseRecordOf(bytes);
  ASSERT_THAT(KeepCase(stores_->cases(), record, bytes), IsOk());
  RunSql(GetParam().sql);
  EXPECT_THAT(stores_->meshes().Read(mesh), StatusIs(Code::kDataLoss));
  EXPECT_THAT(stores_->meshes().Read(mesh), StatusIs(Code::kNotFound));
  EXPECT_THAT(stores_->predictions().Positions("p"), StatusIs(Code::kDataLoss));
  EXPECT_THAT(stores_->predictions().Positions("p"), StatusIs(Code::kNotFound));
  EXPECT_THAT(stores_->cases().Open(record.key(), 0).status(), StatusIs(Code::kDataLoss));
  EXPECT_THAT(stores_->cases().Open(record.key(), 0).status(), StatusIs(Code::kNotFound));
  EXPECT_EQ(Count("blobs WHERE sha256 LIKE 'damaged %'"), 3) << "what is left of them stays";
  EXPECT_EQ(PutMesh(1, 100'000), mesh);
  EXPECT_THAT(stores_->meshes().Read(mesh), IsOk());
  ASSERT_THAT(KeepCase(stores_->cases(), record, bytes), IsOk());
  EXPECT_THAT(ReadWholeCase(stores_->cases(), record.sha256), IsOk());
}

INSTANTIATE_TEST_SUITE_P(
    Damages, PostgresDamageTest,
    ::testing::Values(
        Damage{"AFlippedByte",
               "UPDATE blob_pieces SET bytes = set_byte(bytes, 77, (get_byte(bytes, "
               "77) + 1) % 256) WHERE number = 1;"},
        Damage{"AnotherHashToo",
               "UPDATE blob_pieces SET bytes = set_byte(bytes, 7, 255 - get_byte(bytes, 7)) WHERE "
               "number = 1; UPDATE blob_pieces SET sha256 = encode(sha256(bytes), 'hex');"},
        Damage{"APieceIsGone", "DELETE FROM blob_pieces WHERE number = 1;"},
        Damage{"APieceIsShorter",
               "UPDATE blob_pieces SET bytes = substr(bytes, 1, 99) WHERE number "
               "= 0;"},
        Damage{"PiecesAreExchanged",
               "UPDATE blob_pieces SET number = 1 - number + 100 WHERE number < 2; UPDATE "
               "blob_pieces SET number = number - 100 WHERE number > 98;"}),
    [](const auto& of) { return of.param.name; });

TEST_F(PostgresStoresTest, ADamagedRecordIsReportedAndLeftOutOfLists) {
  ASSERT_THAT(CreateSession(stores_->sessions(), SampleSession("a", 1)), IsOk());
  ASSERT_THAT(CreateSession(stores_->sessions(), SampleSession("b", 2)), IsOk());
  ASSERT_THAT(CreateSession(stores_->sessions(), SampleSession("c", 3)), IsOk());
  RunSql(
      "UPDATE sessions SET record = set_byte(record, 40, 255 - get_byte(record, 40)) WHERE id = "
      "'b';");
  EXPECT_THAT(GetSession(stores_->sessions(), "b"), StatusIs(Code::kDataLoss));
  SessionStore::ListRequest request{.limit = 1};
  std::vector<std::string> ids;
  do {
    ASSERT_OK_AND_ASSIGN(const SessionStore::Page page, ListSessions(stores_->sessions(), request));
    for (const SessionRecord& record : page.records) ids.push_back(record.id);
    request.after = page.next;
  } while (!request.after.empty());
  EXPECT_THAT(ids, ElementsAre("a", "c"));
  RunSql("UPDATE sessions SET owner = 'mallory' WHERE id = 'a';");
  EXPECT_THAT(GetSession(stores_->sessions(), "a"), StatusIs(Code::kDataLoss))
      << "a row of another's record is nobody's";
}

TEST_F(PostgresStoresTest, RefusesNamesThatAreNotUtf8AndKeepsUnusualOnes) {
  EXPECT_THAT(CreateSession(stores_->sessions(), SampleSession(std::string("a\0b", 3), 1)),
              StatusIs(Code::kInvalidArgument, HasSubstr("UTF-8")));
  EXPECT_THAT(CreateSession(stores_->sessions(), SampleSession("a\xff", 1)),
              StatusIs(Code::kInvalidArgument, HasSubstr("UTF-8")));
  for (const char* odd : {"'; DROP TABLE sessions; --", "Zoë \\ \"", "$1", "%"}) {
    ASSERT_THAT(CreateSession(stores_->sessions(), SampleSession(odd, 1)), IsOk());
    ASSERT_OK_AND_ASSIGN(const SessionRecord found, GetSession(stores_->sessions(), odd));
    EXPECT_EQ(found.id, odd);
  }
}

TEST_F(PostgresStoresTest, ServersThatStartAtOnceMakeItsTablesOnce) {
  stores_.reset();
  EmptyTestDatabase();
  std::vector<std::thread> threads;
  threads.reserve(4);
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([] {
      EXPECT_THAT(PostgresStores::Open({.database = TestDatabaseOptions()}).status(), IsOk());
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(RunSql("SELECT version FROM tissueform_version").Integer(0, 0), kPostgresSchemaVersion);
}

TEST_F(PostgresStoresTest, TablesOfANewerServerAreLeftAlone) {
  RunSql("UPDATE tissueform_version SET version = 99;");
  EXPECT_THAT(PostgresStores::Open({.database = TestDatabaseOptions()}).status(),
              StatusIs(Code::kFailedPrecondition, AllOf(HasSubstr("newer server (version 99"),
                                                        HasSubstr("another database"))));
}

// What version 6 has added.
constexpr char kDropIndexColumns[] =
    "ALTER TABLE sessions DROP COLUMN mesh_sha256, DROP COLUMN project;"
    "ALTER TABLE predictions DROP COLUMN mesh_sha256, DROP COLUMN bytes;"
    "DROP INDEX predictions_by_owner;"
    "ALTER TABLE cases DROP COLUMN project, DROP COLUMN bytes;"
    "ALTER TABLE shares DROP COLUMN owner, DROP COLUMN resource, DROP COLUMN principal;"
    "ALTER TABLE follow_links DROP COLUMN session, DROP COLUMN maker, DROP COLUMN expires_s;"
    "ALTER TABLE mesh_rights DROP COLUMN principal, DROP COLUMN sha256, DROP COLUMN bytes;";

TEST_F(PostgresStoresTest, RowsFromBeforeThereWereIndexColumnsAreFoundByThem) {
  ASSERT_THAT(CreateSession(stores_->sessions(), SampleSession("s", 1), 7), IsOk());
  const ShareRow share = {.resource = "projects/project 1", .owner = "planner", .principal = "bob"};
  ASSERT_THAT(SqlAccessStore(&stores_->database()).PutShare(share, /*most=*/1), IsOk());
  stores_.reset();
  RunSql(absl::StrCat(kDropIndexColumns, "UPDATE tissueform_version SET version = 5;"));
  stores_ = OpenTestStores();
  AccessQueries queries(&stores_->database());
  ASSERT_OK_AND_ASSIGN(const std::optional<SessionGrant> found, queries.FindSession("s", "bob"));
  ASSERT_TRUE(found.has_value());
  EXPECT_EQ(found->role, ShareRole::kViewer);
  EXPECT_EQ(found->mesh_sha256, SampleSession("s", 1).mesh_sha256);
}

TEST_F(PostgresStoresTest, UpgradesTablesOfThePreviousVersionWithTheirData) {
  ASSERT_THAT(CreateSession(stores_->sessions(), SampleSession("s", 1), 7), IsOk());
  const std::string mesh = PutMesh(1);
  stores_.reset();
  RunSql(kDropIndexColumns);
  RunSql(
      "DROP TABLE exports, nodes; DROP SEQUENCE session_epochs; UPDATE tissueform_version SET "
      "version = 4;");
  stores_ = OpenTestStores();
  EXPECT_EQ(RunSql("SELECT version FROM tissueform_version").Integer(0, 0), kPostgresSchemaVersion);
  EXPECT_EQ(Count("exports"), 0);
  EXPECT_THAT(GetSession(stores_->sessions(), "s"), IsOk());
  ASSERT_OK_AND_ASSIGN(const SessionRecord next,
                       CreateSession(stores_->sessions(), SampleSession("t", 1), kFreshEpoch));
  EXPECT_EQ(next.epoch, 8) << "greater than those that were counted for each session";
  EXPECT_THAT(stores_->meshes().Read(mesh), IsOk());
}

TEST_F(PostgresStoresTest, OpenReportsAWrongPasswordWithoutRepeatingIt) {
  PostgresOptions options = TestDatabaseOptions();
  options.password = "hush-hush";
  EXPECT_THAT(PostgresStores::Open({.database = options}).status(),
              StatusIs(Code::kFailedPrecondition,
                       AllOf(HasSubstr("the password file"), Not(HasSubstr("hush")))));
}

TEST_F(PostgresStoresTest, ADatabaseThatIsNotThereIsUnavailable) {
  EXPECT_THAT(PostgresStores::Open({.database = TestDatabaseOptions("nowhere")}).status(),
              StatusIs(Code::kUnavailable, HasSubstr("nowhere")));
  PostgresOptions options = TestDatabaseOptions();
  options.url = "postgresql://postgres@127.0.0.1:1/postgres";
  EXPECT_THAT(PostgresStores::Open({.database = options}).status(),
              StatusIs(Code::kUnavailable, HasSubstr("postgresql://127.0.0.1:1/postgres")));
}

TEST_F(PostgresStoresTest, ReadOnlyDatabaseIsRefusedAtStartAndAwaitedByCalls) {
  MakeAway();
  const auto hasty = OpenAway(std::chrono::milliseconds(150));
  const auto patient = OpenAway(std::chrono::seconds(30));
  ASSERT_THAT(CreateSession(hasty->sessions(), SampleSession("s", 1)), IsOk());
  // As after a failover that has made a replica of it.
  RunOutsideTransaction("ALTER DATABASE away SET default_transaction_read_only = on");
  RunSql("SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity WHERE datname = 'away'");
  EXPECT_THAT(PostgresStores::Open({.database = TestDatabaseOptions("away")}).status(),
              StatusIs(Code::kFailedPrecondition, HasSubstr("read-only replica")));
  std::promise<absl::Status> answer;
  patient->sessions().CommitPoses("s", SamplePoses(5), 1,
                                  [&](const absl::Status& status) { answer.set_value(status); });
  EXPECT_THAT(CommitPoses(hasty->sessions(), "s", SamplePoses(4)),
              StatusIs(Code::kUnavailable, HasSubstr("read-only replica")));
  RunOutsideTransaction("ALTER DATABASE away RESET default_transaction_read_only");
  EXPECT_THAT(answer.get_future().get(), IsOk());
}

TEST_F(PostgresStoresTest, CallsGoOnWhenTheDatabaseHasEndedTheirConnections) {
  ASSERT_THAT(CreateSession(stores_->sessions(), SampleSession("s", 1)), IsOk());
  for (int round = 0; round < 3; ++round) {
    RunSql(
        "SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity WHERE application_name = "
        "'tissueform-server' AND pid <> pg_backend_pid()");
    EXPECT_THAT(CommitPoses(stores_->sessions(), "s", SamplePoses(round)), IsOk());
  }
}

TEST_F(PostgresStoresTest, CallWaitsALimitedTimeForTheDatabaseToReturn) {
  MakeAway();
  const auto hasty = OpenAway(std::chrono::milliseconds(150));
  const auto patient = OpenAway(std::chrono::seconds(30));
  ASSERT_THAT(CreateSession(hasty->sessions(), SampleSession("s", 1)), IsOk());
  RunOutsideTransaction("ALTER DATABASE away ALLOW_CONNECTIONS false");
  RunSql("SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity WHERE datname = 'away'");
  std::promise<absl::Status> answer;
  patient->sessions().CommitPoses("s", SamplePoses(5), 1,
                                  [&](const absl::Status& status) { answer.set_value(status); });
  EXPECT_THAT(CommitPoses(hasty->sessions(), "s", SamplePoses(4)),
              StatusIs(Code::kUnavailable, HasSubstr("away")));
  RunOutsideTransaction("ALTER DATABASE away ALLOW_CONNECTIONS true");
  EXPECT_THAT(answer.get_future().get(), IsOk());
  ASSERT_OK_AND_ASSIGN(const SessionRecord found, GetSession(patient->sessions(), "s"));
  EXPECT_EQ(SerializePoses(found.last_poses), SerializePoses(SamplePoses(5)));
}

TEST_F(PostgresStoresTest, RefusesADatabaseWithoutTlsIfTlsIsRequired) {
  PostgresOptions options = TestDatabaseOptions();
  absl::StrAppend(&options.url, "?sslmode=verify-full&sslrootcert=/nowhere.pem");
  EXPECT_THAT(PostgresStores::Open({.database = options}).status(),
              StatusIs(Code::kUnavailable, AnyOf(HasSubstr("SSL"), HasSubstr("certificate"))));
}

TEST_F(PostgresStoresTest, TheSecondOfTwoEqualChangesInOneSecondIsRefusedAsStale) {
  SqlExportStore store(&stores_->database());
  const auto clock = [] { return int64_t{1'800'000'000}; };
  ExportQueue here({}, &store, clock);
  ExportQueue there({}, &store, clock);
  ASSERT_OK_AND_ASSIGN(const ExportRecord made, here.Create({.prediction = "p"}));
  ASSERT_THAT(there.ReloadRows(), IsOk());
  const ExportQueue::Change change = {.etag = ExportQueue::EtagOf(made),
                                      .state = ExportState::kStoring};
  ASSERT_THAT(there.Update(made.id, change), IsOk());
  EXPECT_TRUE(HasReason(here.Update(made.id, change).status(), ErrorReason::kStaleEtag));
}

TEST_F(PostgresStoresTest, AMeshThatASessionIsMadeFromCannotBeDeleted) {
  const std::string mesh = PutMesh(1);
  ASSERT_THAT(CreateSession(stores_->sessions(), SampleSession("s", 1)), IsOk());
  const absl::Status refusal = stores_->meshes().Delete(mesh);
  EXPECT_THAT(refusal, StatusIs(Code::kFailedPrecondition, HasSubstr("1 session is made from it")));
  EXPECT_TRUE(HasReason(refusal, ErrorReason::kMeshInUse));
  ASSERT_THAT(DeleteSession(stores_->sessions(), "s"), IsOk());
  ASSERT_THAT(stores_->meshes().Delete(mesh), IsOk());
  EXPECT_THAT(CreateSession(stores_->sessions(), SampleSession("s", 1)), StatusIs(Code::kNotFound))
      << "of a mesh that is gone no session is made";
}

}  // namespace
}  // namespace tissueform::testing
