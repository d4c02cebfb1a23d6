// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "server/app/backup/back_up.h"
#include "server/app/backup/restore_backup.h"
#include "server/store/durable_store.h"
#include "server/store/store_schema.h"
#include "tests/server/store/store_samples.h"
#include "tests/server/store/store_workload.h"
#include "tests/server/store/stores_case.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::StatusIs;

namespace fs = std::filesystem;

std::unique_ptr<DurableStore> OpenStore(const std::string& path) {
  auto folder = DataFolder::Open(path);
  EXPECT_THAT(folder, IsOk());
  if (!folder.ok()) return nullptr;
  auto store = DurableStore::Open(*std::move(folder));
  EXPECT_THAT(store.status(), IsOk());
  return store.ok() ? *std::move(store) : nullptr;
}

class BackupTest : public ::testing::Test {
 protected:
  void SetUp() override {
    store_ = OpenStore(data_);
    ASSERT_NE(store_, nullptr);
    for (int number = 0; number < kStepsOfARound; ++number) {
      ASSERT_THAT(RunStep(number, /*bursts=*/true, *store_), IsOk());
      ApplyStep(number, /*bursts=*/true, &model_);
    }
    model_.uploads.clear();  // no part of a backup
    ASSERT_FALSE(model_.cases.empty());
  }

  std::string KeepCaseOf(int number) {
    const std::string bytes = SampleCase(number);
    EXPECT_THAT(KeepCase(store_->cases(), CaseRecordOf(bytes), bytes), IsOk());
    return CaseRecordOf(bytes).sha256;
  }

  // The backup is whole, and a server that is given it knows the model.
  void ExpectHolds(const std::string& backup, const StoreModel& model) {
    EXPECT_THAT(VerifyBackup(backup), IsOk());
    const std::string restored = backup + "-restored";
    ASSERT_THAT(RestoreBackup(backup, restored), IsOk());
    const std::unique_ptr<DurableStore> store = OpenStore(restored);
    ASSERT_NE(store, nullptr);
    EXPECT_THAT(store->damaged(), IsEmpty());
    EXPECT_THAT(CheckAgainst(model, model, *store), IsOk());
  }

  const ScratchFolder scratch_;
  const std::string data_ = scratch_ / "data";
  const std::string backup_ = scratch_ / "backup";
  StoreModel model_;
  std::unique_ptr<DurableStore> store_;
};

TEST_F(BackupTest, HoldsDataAcknowledgedBeforeItAndNoLaterData) {
  const absl::StatusOr<BackupSummary> summary = BackUp(data_, backup_);
  ASSERT_THAT(summary, IsOk());
  EXPECT_EQ(summary->schema_version, kSchemaVersion);
  const auto blobs = fs::directory_iterator(backup_ + "/blobs");
  EXPECT_EQ(summary->files, 1 + std::distance(begin(blobs), end(blobs)));
  for (int number = kStepsOfARound; number < 2 * kStepsOfARound; ++number) {
    ASSERT_THAT(RunStep(number, /*bursts=*/true, *store_), IsOk());
  }
  ExpectHolds(backup_, model_);
}

TEST_F(BackupTest, WorksForAStoppedServer) {
  store_.reset();
  ASSERT_THAT(BackUp(data_, backup_), IsOk());
  ExpectHolds(backup_, model_);
  store_ = OpenStore(data_);
  EXPECT_THAT(CheckAgainst(model_, model_, *store_), IsOk());
}

TEST_F(BackupTest, IsWholeWhileOthersWriteAndDelete) {
  std::atomic<bool> stop = false;
  // A round keeps a case, and a server keeps 100.
  constexpr int kMostSteps = 90 * kStepsOfARound;
  std::thread writer([&] {
    for (int number = kStepsOfARound; !stop && number < kMostSteps; ++number) {
      ASSERT_THAT(RunStep(number, /*bursts=*/true, *store_), IsOk());
    }
  });
  for (int i = 0; i < 5; ++i) {
    const std::string backup = absl::StrCat(backup_, i);
    EXPECT_THAT(BackUp(data_, backup), IsOk());
    EXPECT_THAT(VerifyBackup(backup), IsOk());
    const std::string restored = absl::StrCat(backup, "-restored");
    EXPECT_THAT(RestoreBackup(backup, restored), IsOk());
    const std::unique_ptr<DurableStore> store = OpenStore(restored);
    ASSERT_NE(store, nullptr);
    EXPECT_THAT(store->damaged(), IsEmpty());
    for (const int number : model_.cases) {
      EXPECT_THAT(ReadWholeCase(store->cases(), CaseRecordOf(SampleCase(number)).sha256), IsOk());
    }
  }
  stop = true;
  writer.join();
}

TEST_F(BackupTest, CasesDeletedBetweenRowsAndFilesAreInNeither) {
  std::map<std::string, int> numbers;
  for (int number = 5000; number < 5004; ++number) numbers[KeepCaseOf(number)] = number;
  std::vector<std::string> cases;
  cases.reserve(numbers.size());
  for (const auto& [sha256, number] : numbers) cases.push_back(sha256);
  // By the third copy of the rows one file was copied for nothing, and two were never found.
  const std::vector<std::vector<int>> deleted_after = {{2}, {0, 3}, {}};
  size_t snapshots = 0;
  const BackUpOptions options{.after_snapshot = [&] {
    for (const int index : deleted_after[snapshots++]) {
      ASSERT_THAT(store_->cases().Delete(SampleCaseKey(cases[static_cast<size_t>(index)])), IsOk());
    }
  }};
  ASSERT_THAT(BackUp(data_, backup_, options), IsOk());
  EXPECT_EQ(snapshots, deleted_after.size());
  for (size_t i = 0; i < cases.size(); ++i) {
    EXPECT_EQ(fs::exists(backup_ + "/blobs/" + cases[i]), i == 1) << i;
  }
  model_.cases.insert(numbers[cases[1]]);
  ExpectHolds(backup_, model_);
}

TEST_F(BackupTest, ReportsARowWithoutItsFileAndLeavesNothing) {
  const std::string sha256 = KeepCaseOf(5000);
  fs::remove(data_ + "/blobs/" + sha256);
  EXPECT_THAT(BackUp(data_, backup_), StatusIs(absl::StatusCode::kAborted, HasSubstr("missing")));
  EXPECT_FALSE(fs::exists(backup_));
}

TEST_F(BackupTest, RefusesToVerifyAFolderThatIsNotABackup) {
  EXPECT_THAT(VerifyBackup(::testing::TempDir()),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("not a backup")));
}

TEST_F(BackupTest, ReportsADamagedFileAndLeavesNothing) {
  const std::string sha256 = KeepCaseOf(5000);
  fs::resize_file(data_ + "/blobs/" + sha256, 3);
  EXPECT_THAT(BackUp(data_, backup_), StatusIs(absl::StatusCode::kDataLoss, HasSubstr(sha256)));
  EXPECT_FALSE(fs::exists(backup_));
}

TEST_F(BackupTest, IsAccessibleOnlyToItsOwner) {
  ASSERT_THAT(BackUp(data_, backup_), IsOk());
  for (const auto& entry : fs::recursive_directory_iterator(scratch_.path())) {
    if (entry.path().string().rfind(backup_, 0) != 0) continue;
    EXPECT_EQ(
        fs::status(entry.path()).permissions() & (fs::perms::group_all | fs::perms::others_all),
        fs::perms::none)
        << entry.path();
  }
}

TEST_F(BackupTest, DoesNotTouchANonEmptyFolder) {
  fs::create_directory(backup_);
  fs::create_directory(backup_ + "/something");
  EXPECT_THAT(BackUp(data_, backup_), StatusIs(absl::StatusCode::kAlreadyExists));
  EXPECT_FALSE(fs::exists(backup_ + "/tissueform.db"));
}

TEST_F(BackupTest, CreatesNothingWithoutADataFolder) {
  EXPECT_THAT(BackUp(scratch_ / "nowhere", backup_), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_FALSE(fs::exists(scratch_ / "nowhere"));
  EXPECT_FALSE(fs::exists(backup_));
}

TEST_F(BackupTest, CopiesToAnotherDisk) {
  const ScratchFolder other("/dev/shm");
  std::error_code error;
  fs::create_hard_link(data_ + "/lock", other / "probe", error);
  if (!error) GTEST_SKIP() << "/dev/shm is on the disk of the tests";
  ASSERT_THAT(BackUp(data_, other / "backup"), IsOk());
  ExpectHolds(other / "backup", model_);
}

// A program that is not ours reads it.
TEST_F(BackupTest, PassesSha256sum) {
  ASSERT_THAT(BackUp(data_, backup_), IsOk());
  const std::string command = "cd " + backup_ + " && sha256sum --check --strict --quiet SHA256SUMS";
  EXPECT_EQ(std::system(command.c_str()), 0);
}

// The way back from an upgrade: what was backed up before is, restored, what the older server left.
TEST_F(BackupTest, KeepsAnOlderVersionUntilAServerUpgradesIt) {
  const std::string older = scratch_ / "older";
  fs::copy(testing::SourcePath("tests/data/store/version2"), older, fs::copy_options::recursive);
  fs::permissions(older, fs::perms::owner_all);
  const absl::StatusOr<BackupSummary> before = BackUp(older, backup_);
  ASSERT_THAT(before, IsOk());
  EXPECT_EQ(before->schema_version, 2);
  OpenStore(older).reset();
  const absl::StatusOr<BackupSummary> after = BackUp(older, backup_ + "-after");
  ASSERT_THAT(after, IsOk());
  EXPECT_EQ(after->schema_version, kSchemaVersion);
  const absl::StatusOr<BackupSummary> restored = RestoreBackup(backup_, scratch_ / "rolled-back");
  ASSERT_THAT(restored, IsOk());
  EXPECT_EQ(restored->schema_version, 2);
  EXPECT_THAT(ReadBackupContents(scratch_ / "rolled-back/tissueform.db")->schema_version, 2);
  StoreModel model;
  for (int number = 0; number < 16; ++number) ApplyStep(number, /*bursts=*/true, &model);
  model.uploads.clear();
  const std::unique_ptr<DurableStore> store = OpenStore(scratch_ / "rolled-back");
  ASSERT_NE(store, nullptr);
  EXPECT_THAT(CheckAgainst(model, model, *store), IsOk());
}

}  // namespace
}  // namespace tissueform
