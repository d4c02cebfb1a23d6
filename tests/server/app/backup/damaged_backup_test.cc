// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <memory>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <sys/stat.h>

#include "server/app/backup/back_up.h"
#include "server/app/backup/restore_backup.h"
#include "server/store/durable_store.h"
#include "tests/server/store/store_samples.h"
#include "tests/server/store/stores_case.h"
#include "tests/testing/status_matchers.h"

// What is wrong with a backup is found before anything of it is used.
namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::StatusIs;

namespace fs = std::filesystem;

// Turns one byte over.
void TurnByte(const std::string& path, int64_t place) {
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  file.seekg(place);
  const char byte = static_cast<char>(file.get() ^ 1);
  file.seekp(place);
  file.put(byte);
}

void Sql(const std::string& backup, const std::string& sql) {
  const auto database = Database::Open(BackupDatabase(backup));
  ASSERT_THAT(database.status(), IsOk());
  ASSERT_THAT((*database)->Execute(sql), IsOk());
}

std::string FirstBlob(const std::string& backup) {
  return fs::directory_iterator(backup + "/blobs")->path();
}

class DamagedBackup : public ::testing::Test {
 protected:
  void SetUp() override {
    auto folder = DataFolder::Open(scratch_ / "data");
    ASSERT_THAT(folder, IsOk());
    const auto store = DurableStore::Open(*std::move(folder));
    ASSERT_THAT(store.status(), IsOk());
    const std::string bytes = SampleCase(1);
    ASSERT_THAT(KeepCase((*store)->cases(), CaseRecordOf(bytes), bytes), IsOk());
    ASSERT_THAT(BackUp(scratch_ / "data", backup_), IsOk());
  }

  const ScratchFolder scratch_;
  const std::string backup_ = scratch_ / "backup";
  const std::string target_ = scratch_ / "target";
};

struct Damage {
  const char* name;
  std::function<void(const std::string& backup)> make;
  absl::StatusCode code = absl::StatusCode::kDataLoss;
};

class DamagedBackupTest : public DamagedBackup, public ::testing::WithParamInterface<Damage> {};

TEST_P(DamagedBackupTest, IsFoundAndNothingIsRestored) {
  ASSERT_THAT(VerifyBackup(backup_), IsOk());
  ASSERT_NO_FATAL_FAILURE(GetParam().make(backup_));
  EXPECT_THAT(VerifyBackup(backup_), StatusIs(GetParam().code));
  EXPECT_THAT(RestoreBackup(backup_, target_), StatusIs(GetParam().code));
  EXPECT_TRUE(!fs::exists(target_) || fs::is_empty(target_));
}

INSTANTIATE_TEST_SUITE_P(
    , DamagedBackupTest,
    ::testing::Values(
        Damage{"ByteOfTheDatabase",
               [](const std::string& b) {
                 TurnByte(BackupDatabase(b),
                          static_cast<int64_t>(fs::file_size(BackupDatabase(b))) - 1);
               }},
        Damage{"DatabaseCut",
               [](const std::string& b) { fs::resize_file(BackupDatabase(b), 5000); }},
        Damage{"DatabaseMissing", [](const std::string& b) { fs::remove(BackupDatabase(b)); }},
        Damage{"DatabaseEmpty",
               [](const std::string& b) { fs::resize_file(BackupDatabase(b), 0); }},
        Damage{"ByteOfABlob", [](const std::string& b) { TurnByte(FirstBlob(b), 7); }},
        Damage{"BlobMissing", [](const std::string& b) { fs::remove(FirstBlob(b)); }},
        Damage{"BlobIsAPipe",
               [](const std::string& b) {
                 const std::string path = FirstBlob(b);
                 fs::remove(path);
                 ASSERT_EQ(mkfifo(path.c_str(), 0600), 0);
               }},
        Damage{"BlobIsALinkOutside",
               [](const std::string& b) {
                 const std::string path = FirstBlob(b);
                 fs::remove(path);
                 fs::create_symlink("/etc/hostname", path);
               }},
        Damage{"DigestsCut", [](const std::string& b) { fs::resize_file(BackupSums(b), 20); }},
        Damage{"DigestsTooLong",
               [](const std::string& b) { std::ofstream(BackupSums(b), std::ios::app) << "more"; }},
        Damage{"DigestsMissing", [](const std::string& b) { fs::remove(BackupSums(b)); }},
        Damage{"RowsChanged",
               [](const std::string& b) { Sql(b, "UPDATE cases SET last_used_s = 1"); }},
        Damage{"ClaimsAFileOutside",
               [](const std::string& b) { Sql(b, "UPDATE cases SET sha256 = '../lock'"); }},
        Damage{"OfANewerServer", [](const std::string& b) { Sql(b, "PRAGMA user_version = 99"); },
               absl::StatusCode::kFailedPrecondition},
        Damage{"OfAnotherProgram",
               [](const std::string& b) { Sql(b, "PRAGMA application_id = 1"); },
               absl::StatusCode::kFailedPrecondition},
        Damage{"NoBackup", [](const std::string& b) { fs::remove_all(b); },
               absl::StatusCode::kNotFound}),
    [](const auto& param) { return std::string(param.param.name); });

TEST_F(DamagedBackup, DoesNotRestoreIntoANonEmptyFolder) {
  EXPECT_THAT(RestoreBackup(backup_, scratch_ / "data"),
              StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("empty folder")));
  fs::create_directory(target_);
  std::ofstream(target_ + "/mine") << "mine";
  EXPECT_THAT(RestoreBackup(backup_, target_), StatusIs(absl::StatusCode::kAlreadyExists));
  EXPECT_TRUE(fs::exists(target_ + "/mine"));
}

TEST_F(DamagedBackup, RestoringAgainAfterAFailureWorks) {
  const std::string blob = FirstBlob(backup_);
  TurnByte(blob, 7);
  EXPECT_THAT(RestoreBackup(backup_, target_), StatusIs(absl::StatusCode::kDataLoss));
  TurnByte(blob, 7);
  EXPECT_THAT(RestoreBackup(backup_, target_), IsOk());
}

}  // namespace
}  // namespace tissueform
