// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/durable_store.h"

#include <atomic>
#include <filesystem>
#include <fstream>
#include <future>
#include <iterator>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mesh/payload/sha256.h"
#include "server/exports/export_store.h"
#include "server/platform/storage/database.h"
#include "server/store/access_queries.h"
#include "server/store/sql_access_store.h"
#include "server/store/store_records.h"
#include "server/store/store_schema.h"
#include "tests/server/store/store_samples.h"
#include "tests/server/store/store_workload.h"
#include "tests/server/store/stores_case.h"
#include "tests/server/store/waiting_calls.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

// What a store keeps through restarts, and what it makes of a folder that is not as it left it.
namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::StatusIs;

std::string ReadFile(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

class DurableStoreTest : public ::testing::Test {
 protected:
  absl::Status Open(const DurableStoreOptions& options = {}) {
    store_.reset();
    auto folder = DataFolder::Open(path_);
    if (!folder.ok()) return folder.status();
    auto store = DurableStore::Open(*std::move(folder), options);
    if (!store.ok()) return store.status();
    store_ = *std::move(store);
    return absl::OkStatus();
  }
  // A session, a mesh and a prediction of each number up to `count`.
  void Fill(int count) {
    for (int number = 0; number < count; ++number) {
      const std::string id = absl::StrCat("s", number);
      ASSERT_THAT(CreateSession(store_->sessions(), SampleSession(id, number)), IsOk());
      ASSERT_THAT(CommitPoses(store_->sessions(), id, SamplePoses(number)), IsOk());
      const MeshPayload mesh = SamplePayload(number);
      ASSERT_THAT(store_->meshes().Put(RecordOf(mesh), mesh.View()), IsOk());
      const std::string p = absl::StrCat("p", number);
      ASSERT_THAT(store_->predictions().Create(SamplePrediction(p), SamplePositions(number)),
                  IsOk());
    }
  }
  void ExpectSession(int number) {
    SessionRecord expected = SampleSession(absl::StrCat("s", number), number);
    expected.last_poses = SamplePoses(number);
    ASSERT_OK_AND_ASSIGN(const SessionRecord found, GetSession(store_->sessions(), expected.id));
    EXPECT_EQ(SerializeRecord(found), SerializeRecord(expected));
  }
  void ExpectMesh(int number) {
    const MeshPayload mesh = SamplePayload(number);
    ASSERT_OK_AND_ASSIGN(const MeshPayload read, store_->meshes().Read(RecordOf(mesh).sha256));
    EXPECT_EQ(read.View().segments, mesh.View().segments);
  }
  void ExpectPrediction(int number) {
    ASSERT_OK_AND_ASSIGN(const std::string positions,
                         store_->predictions().Positions(absl::StrCat("p", number)));
    EXPECT_EQ(positions, SamplePositions(number));
  }
  // Changes the rows behind the store's back.
  void Sql(const std::string& sql) {
    store_.reset();
    ASSERT_OK_AND_ASSIGN(const auto database, Database::Open(path_ + "/tissueform.db"));
    ASSERT_THAT(database->Execute(sql), IsOk());
  }
  std::string Blob(const std::string& sha256) const { return path_ + "/blobs/" + sha256; }
  size_t Blobs() const {
    const std::filesystem::directory_iterator files(path_ + "/blobs");
    return static_cast<size_t>(std::distance(begin(files), end(files)));
  }

  const ScratchFolder scratch_;
  const std::string path_ = scratch_ / "data";
  std::unique_ptr<DurableStore> store_;
};

TEST_F(DurableStoreTest, EverythingIsThereAfterARestart) {
  ASSERT_THAT(Open(), IsOk());
  Fill(3);
  const MeshPayload upload = SamplePayload(9);
  ASSERT_THAT(store_->uploads().Begin(AnnouncementOf(upload)), IsOk());
  ASSERT_THAT(store_->uploads().Append(RecordOf(upload).sha256, 0, "0123"), IsOk());
  ASSERT_THAT(store_->uploads().Committed(RecordOf(upload).sha256), IsOk());
  ASSERT_OK_AND_ASSIGN(const SessionRecord before, GetSession(store_->sessions(), "s1"));
  ASSERT_THAT(Open(), IsOk());
  EXPECT_THAT(store_->damaged(), IsEmpty());
  for (int number = 0; number < 3; ++number) {
    ExpectSession(number);
    ExpectMesh(number);
    ExpectPrediction(number);
  }
  ASSERT_OK_AND_ASSIGN(const SessionRecord after, GetSession(store_->sessions(), "s1"));
  EXPECT_EQ(after.etag, before.etag);
  EXPECT_EQ(after.epoch, before.epoch);
  EXPECT_EQ(after.created_s, before.created_s);
  EXPECT_EQ(after.last_used_s, before.last_used_s);
  ASSERT_OK_AND_ASSIGN(const int64_t committed,
                       store_->uploads().Committed(RecordOf(upload).sha256));
  EXPECT_EQ(committed, 4);
}

TEST_F(DurableStoreTest, FilesAreAccessibleOnlyToTheirOwner) {
  ASSERT_THAT(Open(), IsOk());
  Fill(1);
  const auto others = std::filesystem::perms::group_all | std::filesystem::perms::others_all;
  int files = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(path_)) {
    EXPECT_EQ(entry.status().permissions() & others, std::filesystem::perms::none) << entry.path();
    ++files;
  }
  EXPECT_GE(files, 7);
}

TEST_F(DurableStoreTest, DeletedRecordsAreNowhereInItsFiles) {
  ASSERT_THAT(Open(), IsOk());
  Fill(4);
  SessionRecord secret = SampleSession("secret", 5);
  secret.project = "what nobody shall find any longer";
  ASSERT_THAT(CreateSession(store_->sessions(), secret), IsOk());
  PredictionRecord prediction = SamplePrediction("hidden");
  prediction.metadata = "nor this";
  ASSERT_THAT(store_->predictions().Create(prediction, SamplePositions(77)), IsOk());
  const auto found = [&](const std::string& text) {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(path_)) {
      if (entry.is_regular_file() && absl::StrContains(ReadFile(entry.path()), text)) return true;
    }
    return false;
  };
  EXPECT_TRUE(found(secret.project));
  EXPECT_TRUE(found(SamplePositions(77).substr(0, 100)));
  ASSERT_THAT(DeleteSession(store_->sessions(), "secret"), IsOk());
  ASSERT_THAT(store_->predictions().Delete("hidden"), IsOk());
  EXPECT_FALSE(found(secret.project));
  EXPECT_FALSE(found("secret"));
  EXPECT_FALSE(found(prediction.metadata));
  EXPECT_FALSE(found(SamplePositions(77).substr(0, 100)));
  ExpectSession(1);
  ExpectPrediction(1);
}

TEST_F(DurableStoreTest, ABackupReaderDoesNotStopADeleteAndTheLogIsEmptiedAfterIt) {
  ASSERT_THAT(Open(), IsOk());
  Fill(2);
  const std::string log = path_ + "/tissueform.db-wal";
  {
    ASSERT_OK_AND_ASSIGN(const auto reader, Database::Open(path_ + "/tissueform.db"));
    ASSERT_THAT(reader->Execute("BEGIN; SELECT * FROM sessions"), IsOk());
    ASSERT_THAT(DeleteSession(store_->sessions(), "s0"), IsOk());
    EXPECT_GT(std::filesystem::file_size(log), 0U) << "the reader needs it";
  }
  ASSERT_THAT(DeleteSession(store_->sessions(), "s1"), IsOk());
  EXPECT_EQ(std::filesystem::file_size(log), 0U);
}

// As docs/operations.md describes it: the database first, then the files.
TEST_F(DurableStoreTest, ABackupThatWasMadeWhileItServesOpens) {
  ASSERT_THAT(Open(), IsOk());
  Fill(3);
  const std::string backup = scratch_ / "backup";
  std::filesystem::create_directory(backup);
  std::filesystem::permissions(backup, std::filesystem::perms::owner_all);
  {
    ASSERT_OK_AND_ASSIGN(const auto reader, Database::Open(path_ + "/tissueform.db"));
    ASSERT_THAT(reader->Execute("VACUUM INTO '" + backup + "/tissueform.db'"), IsOk());
  }
  ASSERT_THAT(store_->predictions().Create(SamplePrediction("later"), SamplePositions(8)), IsOk());
  std::filesystem::copy(path_ + "/blobs", backup + "/blobs");
  auto folder = DataFolder::Open(backup);
  ASSERT_THAT(folder, IsOk());
  auto restored = DurableStore::Open(*std::move(folder));
  ASSERT_THAT(restored.status(), IsOk());
  EXPECT_THAT((*restored)->damaged(), IsEmpty());
  store_ = *std::move(restored);
  for (int number = 0; number < 3; ++number) {
    ExpectSession(number);
    ExpectMesh(number);
    ExpectPrediction(number);
  }
  EXPECT_THAT(store_->predictions().Get("later"), StatusIs(absl::StatusCode::kNotFound));
}

TEST_F(DurableStoreTest, ADamagedRowIsSetAsideAndTheRestServes) {
  ASSERT_THAT(Open(), IsOk());
  Fill(3);
  Sql("UPDATE sessions SET record = CAST(replace(CAST(record AS TEXT), 'chin', 'chim') AS BLOB) "
      "WHERE id = 's0';"
      "UPDATE session_states SET poses = x'00' WHERE key = (SELECT key FROM sessions WHERE id = "
      "'s1');"
      "UPDATE predictions SET record = zeroblob(80) WHERE id = 'p2';"
      "DELETE FROM session_states WHERE key = (SELECT key FROM sessions WHERE id = 's2');");
  ASSERT_THAT(Open(), IsOk());
  std::set<std::string> what;
  for (const DamagedItem& item : store_->damaged()) {
    what.insert(item.what);
    EXPECT_TRUE(std::filesystem::exists(item.set_aside)) << item.what;
    EXPECT_NE(item.why, "");
  }
  EXPECT_THAT(what,
              ElementsAre("poses \"s1\"", "prediction \"p2\"", "session \"s0\"", "session \"s2\""));
  EXPECT_THAT(GetSession(store_->sessions(), "s0"), StatusIs(absl::StatusCode::kNotFound));
  ASSERT_OK_AND_ASSIGN(const SessionRecord rest, GetSession(store_->sessions(), "s1"));
  EXPECT_THAT(rest.last_poses, IsEmpty()) << "goes on from rest";
  EXPECT_EQ(SerializeRecord(rest), SerializeRecord(SampleSession("s1", 1)));
  ExpectPrediction(1);
  ExpectMesh(2);
  ASSERT_THAT(Open(), IsOk());
  EXPECT_THAT(store_->damaged(), IsEmpty()) << "reported once";
}

TEST_F(DurableStoreTest, ADamagedBlobIsSetAsideAndMayBeUploadedAgain) {
  ASSERT_THAT(Open(), IsOk());
  Fill(3);
  store_.reset();
  const std::string flipped = RecordOf(SamplePayload(0)).sha256;
  const std::string gone = RecordOf(SamplePayload(1)).sha256;
  const std::string cut = Sha256Hex({SamplePositions(2)});
  std::fstream(Blob(flipped), std::ios::in | std::ios::out).seekp(500).put('!');
  std::filesystem::remove(Blob(gone));
  std::filesystem::resize_file(Blob(cut), 17);
  ASSERT_THAT(Open(), IsOk());
  std::set<std::string> what;
  for (const DamagedItem& item : store_->damaged()) what.insert(item.what);
  const std::set<std::string> expected = {"file " + flipped, absl::StrCat("mesh \"", flipped, "\""),
                                          absl::StrCat("mesh \"", gone, "\""), "file " + cut,
                                          "prediction \"p2\""};
  EXPECT_EQ(what, expected);
  EXPECT_THAT(store_->meshes().Find(flipped), StatusIs(absl::StatusCode::kNotFound));
  ExpectMesh(2);
  ExpectPrediction(1);
  for (const int number : {0, 1}) {
    const MeshPayload mesh = SamplePayload(number);
    ASSERT_THAT(store_->meshes().Put(RecordOf(mesh), mesh.View()), IsOk());
    ExpectMesh(number);
  }
}

TEST_F(DurableStoreTest, ABlobThatIsDamagedWhileItServesIsFoundWhenItIsRead) {
  ASSERT_THAT(Open(), IsOk());
  Fill(3);
  const std::string flipped = RecordOf(SamplePayload(0)).sha256;
  const std::string gone = RecordOf(SamplePayload(1)).sha256;
  std::fstream(Blob(flipped), std::ios::in | std::ios::out).seekp(3).put('!');
  std::filesystem::remove(Blob(gone));
  std::fstream(Blob(Sha256Hex({SamplePositions(2)})), std::ios::in | std::ios::out).put('!');
  EXPECT_THAT(store_->meshes().Read(flipped).status(), StatusIs(absl::StatusCode::kDataLoss));
  EXPECT_THAT(store_->meshes().Read(flipped).status(), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_TRUE(std::filesystem::exists(path_ + "/damaged/" + flipped));
  EXPECT_THAT(store_->meshes().Read(gone).status(), StatusIs(absl::StatusCode::kDataLoss));
  EXPECT_THAT(store_->meshes().Find(gone), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_THAT(store_->predictions().Positions("p2"), StatusIs(absl::StatusCode::kDataLoss));
  EXPECT_THAT(store_->predictions().Get("p2"), StatusIs(absl::StatusCode::kNotFound));
  ExpectMesh(2);
}

TEST_F(DurableStoreTest, BlobsThatNoRowClaimsAreRemovedAtTheStart) {
  ASSERT_THAT(Open(), IsOk());
  Fill(1);
  const size_t blobs = Blobs();
  std::ofstream(Blob(std::string(64, 'a'))) << "of a crash before the row";
  std::ofstream(Blob("0123.7.new")) << "of a crash before the name";
  ASSERT_THAT(Open(), IsOk());
  EXPECT_EQ(Blobs(), blobs);
  EXPECT_THAT(store_->damaged(), IsEmpty());
}

TEST_F(DurableStoreTest, BlobsOfALostDatabaseAreKeptAside) {
  ASSERT_THAT(Open(), IsOk());
  Fill(2);
  store_.reset();
  for (const char* suffix : {"", "-wal", "-shm"}) {
    std::filesystem::remove(path_ + "/tissueform.db" + suffix);
  }
  ASSERT_THAT(Open(), IsOk());
  EXPECT_THAT(store_->damaged(), SizeIs(4));
  EXPECT_EQ(Blobs(), 0U);
  EXPECT_TRUE(std::filesystem::exists(path_ + "/damaged/" + RecordOf(SamplePayload(1)).sha256));
}

TEST_F(DurableStoreTest, ADamagedPageCostsItsRowsOnly) {
  constexpr int kSessions = 120;
  ASSERT_THAT(Open(), IsOk());
  for (int number = 0; number < kSessions; ++number) {
    ASSERT_THAT(CreateSession(store_->sessions(), SampleSession(absl::StrCat("s", number), number)),
                IsOk());
  }
  store_.reset();
  const std::string file = path_ + "/tissueform.db";
  const std::string bytes = ReadFile(file);
  constexpr size_t kPage = 4096;
  // In the record, after its length: the indexes hold the text, too.
  const size_t at = bytes.find("\nproject 60") / kPage * kPage;
  ASSERT_GT(at, 0U);
  std::fstream stream(file, std::ios::in | std::ios::out | std::ios::binary);
  stream.seekp(static_cast<std::streamoff>(at)) << std::string(kPage, '\x55');
  stream.close();
  ASSERT_THAT(Open(), IsOk());
  ASSERT_THAT(store_->damaged(), ::testing::Not(IsEmpty()));
  EXPECT_EQ(store_->damaged()[0].what, "the database");
  EXPECT_EQ(std::filesystem::file_size(store_->damaged()[0].set_aside), bytes.size());
  ASSERT_OK_AND_ASSIGN(const SessionStore::Page page,
                       ListSessions(store_->sessions(), {.limit = 1000}));
  EXPECT_GT(page.records.size(), kSessions - 30U);
  EXPECT_LT(page.records.size(), static_cast<size_t>(kSessions));
  for (const SessionRecord& record : page.records) {
    const int number = std::stoi(record.id.substr(1));
    EXPECT_EQ(SerializeRecord(record), SerializeRecord(SampleSession(record.id, number)));
  }
  EXPECT_THAT(CreateSession(store_->sessions(), SampleSession("s60", 60)), IsOk());
  ASSERT_THAT(Open(), IsOk());
  EXPECT_THAT(store_->damaged(), IsEmpty());
}

TEST_F(DurableStoreTest, RefusesAFileThatIsNotADatabaseAndLeavesItUnchanged) {
  ASSERT_THAT(Open(), IsOk());
  Fill(1);
  store_.reset();
  const std::string file = path_ + "/tissueform.db";
  std::ofstream(file, std::ios::trunc) << std::string(10000, 'x');
  EXPECT_THAT(Open(), StatusIs(absl::StatusCode::kDataLoss, HasSubstr("restore a backup")));
  EXPECT_EQ(ReadFile(file), std::string(10000, 'x'));
  EXPECT_EQ(Blobs(), 2U) << "nothing was removed";
}

TEST_F(DurableStoreTest, AStoreOfANewerServerOrAnotherProgramIsRefused) {
  ASSERT_THAT(Open(), IsOk());
  Fill(1);
  Sql("PRAGMA user_version=99");
  EXPECT_THAT(Open(), StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("newer server")));
  Sql(absl::StrCat("PRAGMA user_version=", kSchemaVersion, "; PRAGMA application_id=7"));
  EXPECT_THAT(Open(), StatusIs(absl::StatusCode::kFailedPrecondition,
                               HasSubstr("does not belong to tissueform")));
  Sql("PRAGMA application_id=" + absl::StrCat(0x54697346));
  ASSERT_THAT(Open(), IsOk());
  ExpectSession(0);
}

TEST_F(DurableStoreTest, AStoreOfTheVersionBeforeIsBroughtUpToDate) {
  std::filesystem::create_directory(path_);
  std::filesystem::permissions(path_, std::filesystem::perms::owner_all);
  std::filesystem::create_directory(path_ + "/blobs");
  std::filesystem::copy_file(testing::SourcePath("tests/data/store/version1.db"),
                             path_ + "/tissueform.db");
  const MeshPayload mesh = SamplePayload(0);
  std::ofstream(Blob(RecordOf(mesh).sha256)) << mesh.View().shape.Text() << BytesOf(mesh);
  ASSERT_THAT(Open({.clock = [] { return 4711; }}), IsOk());
  EXPECT_THAT(store_->damaged(), IsEmpty());
  ExpectSession(0);
  ExpectSession(1);
  ExpectMesh(0);
  ASSERT_OK_AND_ASSIGN(const SessionRecord session, GetSession(store_->sessions(), "s1"));
  EXPECT_EQ(session.created_s, 4711);
  EXPECT_EQ(session.last_used_s, 4711);
  EXPECT_EQ(session.epoch, 1);
  ASSERT_OK_AND_ASSIGN(const MeshRecord record, store_->meshes().Find(RecordOf(mesh).sha256));
  EXPECT_EQ(record.last_used_s, 4711);
  EXPECT_THAT(store_->predictions().Create(SamplePrediction("p"), SamplePositions(1)), IsOk());
  ASSERT_THAT(Open(), IsOk());
  ExpectSession(1);
}

TEST_F(DurableStoreTest, RightsAndExportsAreThereAfterARestart) {
  ASSERT_THAT(Open(), IsOk());
  const FollowLinkRow link = {.digest = std::string(64, 'd'), .session = "a", .maker = "ann"};
  const ExportRecord record = {.id = "a", .prediction = "p"};
  ASSERT_THAT(CreateSession(store_->sessions(), SampleSession("a", 1)), IsOk());
  ASSERT_THAT(SqlAccessStore(&store_->database()).PutLink(link, /*now_s=*/0, /*most=*/1), IsOk());
  ASSERT_THAT(SqlExportStore(&store_->database()).Put(record), IsOk());
  ASSERT_THAT(Open(), IsOk());
  ASSERT_OK_AND_ASSIGN(const std::optional<LinkGrant> kept,
                       AccessQueries(&store_->database()).FindLink(link.digest));
  ASSERT_TRUE(kept.has_value());
  EXPECT_EQ(kept->link, link);
  EXPECT_THAT(SqlExportStore(&store_->database()).Load(), IsOk());
  EXPECT_THAT(*SqlExportStore(&store_->database()).Load(), ElementsAre(record));
}

TEST_F(DurableStoreTest, AMeshThatASessionIsMadeFromCannotBeDeleted) {
  ASSERT_THAT(Open(), IsOk());
  const MeshPayload mesh = SamplePayload(1);
  ASSERT_THAT(store_->meshes().Put(RecordOf(mesh), mesh.View()), IsOk());
  ASSERT_THAT(CreateSession(store_->sessions(), SampleSession("s", 1)), IsOk());
  EXPECT_THAT(store_->meshes().Delete(RecordOf(mesh).sha256),
              StatusIs(absl::StatusCode::kFailedPrecondition));
  ASSERT_THAT(DeleteSession(store_->sessions(), "s"), IsOk());
  EXPECT_THAT(store_->meshes().Delete(RecordOf(mesh).sha256), IsOk());
}

TEST_F(DurableStoreTest, ASecondServerIsRefused) {
  ASSERT_THAT(Open(), IsOk());
  EXPECT_THAT(DataFolder::Open(path_).status(), StatusIs(absl::StatusCode::kUnavailable));
}

TEST_F(DurableStoreTest, NothingIsAcknowledgedInAFolderThatIsGone) {
  ASSERT_THAT(Open(), IsOk());
  Fill(1);
  std::filesystem::remove_all(path_);
  EXPECT_THAT(CreateSession(store_->sessions(), SampleSession("s7", 7)),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("removed or replaced")));
  EXPECT_THAT(CommitPoses(store_->sessions(), "s0", SamplePoses(3)),
              StatusIs(absl::StatusCode::kUnavailable));
  const MeshPayload mesh = SamplePayload(5);
  EXPECT_FALSE(store_->meshes().Put(RecordOf(mesh), mesh.View()).ok());
  EXPECT_FALSE(store_->predictions().Create(SamplePrediction("p9"), SamplePositions(9)).ok());
  EXPECT_FALSE(store_->uploads().Begin(AnnouncementOf(mesh)).ok());
}

TEST_F(DurableStoreTest, NothingIsAcknowledgedInADatabaseThatIsReplaced) {
  ASSERT_THAT(Open(), IsOk());
  std::filesystem::rename(path_ + "/tissueform.db", path_ + "/elsewhere");
  EXPECT_THAT(CreateSession(store_->sessions(), SampleSession("s7", 7)),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("removed or replaced")));
}

TEST_F(DurableStoreTest, ABlockingCallFromAnAnswerIsRefusedAndNoDeadlock) {
  ASSERT_THAT(Open(), IsOk());
  std::promise<absl::Status> answer;
  store_->sessions().Touch({"s"}, 1, [&](const absl::Status&) {
    answer.set_value(store_->meshes().Touch({std::string(64, 'a')}, 1));
  });
  EXPECT_THAT(answer.get_future().get(), StatusIs(absl::StatusCode::kInternal));
}

TEST_F(DurableStoreTest, ReadDoesNotWaitForARunningCommit) {
  ASSERT_THAT(Open(), IsOk());
  Fill(1);
  std::promise<void> begun;
  std::promise<void> read;
  std::promise<absl::Status> written;
  store_->database().Submit("other",
                            {.work =
                                 [&](SqlTransaction&) {
                                   begun.set_value();
                                   read.get_future().wait();
                                   return absl::OkStatus();
                                 }},
                            [&](absl::Status status) { written.set_value(std::move(status)); });
  begun.get_future().wait();
  EXPECT_THAT(store_->meshes().List("", 1), IsOk());
  EXPECT_THAT(GetSession(store_->sessions(), "s0"), IsOk());
  read.set_value();
  EXPECT_THAT(written.get_future().get(), IsOk());
}

TEST_F(DurableStoreTest, AReadHasAllThatWasAskedForItsSessionBefore) {
  ASSERT_THAT(Open(), IsOk());
  Fill(1);
  for (int number = 0; number < 100; ++number) {
    const std::vector<HandlePose> poses = SamplePoses(number);
    store_->sessions().CommitPoses("s0", poses, 1, [](const absl::Status&) {});
    ASSERT_OK_AND_ASSIGN(const SessionRecord record, GetSession(store_->sessions(), "s0"));
    ASSERT_EQ(SerializePoses(record.last_poses), SerializePoses(poses));
  }
}

TEST_F(DurableStoreTest, EveryCallIsAnsweredBeforeTheStoreIsGone) {
  ASSERT_THAT(Open(), IsOk());
  std::atomic<int> answers = 0;
  for (int number = 0; number < 300; ++number) {
    store_->sessions().Create(SampleSession(absl::StrCat("s", number), number), 1,
                              [&answers](const absl::StatusOr<SessionRecord>& record) {
                                answers += record.ok() ? 1 : 0;
                              });
  }
  store_.reset();
  EXPECT_EQ(answers, 300);
}

}  // namespace
}  // namespace tissueform
