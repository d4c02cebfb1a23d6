// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <set>
#include <string>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "server/platform/storage/database.h"
#include "server/store/durable_store.h"
#include "tests/server/store/store_samples.h"
#include "tests/server/store/stores_case.h"
#include "tests/testing/status_matchers.h"

// Cases through restarts, and in folders that are not as they were left.
namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::StatusIs;
using Code = absl::StatusCode;

class DurableCaseStoreTest : public ::testing::Test {
 protected:
  DurableCaseStoreTest() { Reopen(); }

  void Reopen() {
    store_.reset();
    store_ = *DurableStore::Open(*DataFolder::Open(path_));
  }
  // Keeps a sample and returns its name.
  std::string Keep(int number) {
    const std::string bytes = SampleCase(number);
    EXPECT_THAT(KeepCase(store_->cases(), CaseRecordOf(bytes), bytes), IsOk());
    return CaseRecordOf(bytes).sha256;
  }
  void ExpectCase(int number) {
    const std::string bytes = SampleCase(number);
    const auto read = ReadWholeCase(store_->cases(), CaseRecordOf(bytes).sha256);
    ASSERT_THAT(read, IsOk());
    EXPECT_EQ(*read, bytes);
  }
  std::set<std::string> Damaged() const {
    std::set<std::string> what;
    for (const DamagedItem& item : store_->damaged()) what.insert(item.what);
    return what;
  }
  void Flip(const std::string& name) const {
    std::fstream(Blob(name), std::ios::in | std::ios::out).seekp(500).put('!');
  }
  std::string Blob(const std::string& name) const { return path_ + "/blobs/" + name; }
  bool Found(const std::string& text) const {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(path_)) {
      if (!entry.is_regular_file()) continue;
      std::ifstream stream(entry.path(), std::ios::binary);
      const std::string bytes{std::istreambuf_iterator<char>(stream),
                              std::istreambuf_iterator<char>()};
      if (absl::StrContains(bytes, text)) return true;
    }
    return false;
  }

  const ScratchFolder scratch_;
  const std::string path_ = scratch_ / "data";
  std::unique_ptr<DurableStore> store_;
};

TEST_F(DurableCaseStoreTest, CasesAreThereAfterARestart) {
  const std::string name = Keep(1);
  Keep(2);
  Reopen();
  EXPECT_THAT(Damaged(), IsEmpty());
  ExpectCase(1);
  ExpectCase(2);
  ASSERT_OK_AND_ASSIGN(const CaseRecord record, store_->cases().Find(SampleCaseKey(name)));
  EXPECT_EQ(record.title, CaseRecordOf(SampleCase(1)).title);
  EXPECT_EQ(record.created_s, 1234);
}

TEST_F(DurableCaseStoreTest, DeletedCasesLeaveNoTraceInItsFiles) {
  const std::string bytes = SampleCase(1);
  CaseRecord record = CaseRecordOf(bytes);
  record.title = "a name that nobody shall find";
  ASSERT_THAT(KeepCase(store_->cases(), record, bytes), IsOk());
  Keep(2);
  EXPECT_TRUE(Found(record.title));
  EXPECT_TRUE(Found(bytes.substr(0, 100)));
  ASSERT_THAT(store_->cases().Delete(SampleCaseKey(record.sha256)), IsOk());
  EXPECT_FALSE(Found(record.title));
  EXPECT_FALSE(Found(record.sha256));
  EXPECT_FALSE(Found(bytes.substr(0, 100)));
  ExpectCase(2);
}

TEST_F(DurableCaseStoreTest, StartRemovesACaseHalfWrittenAtACrash) {
  Keep(1);
  const std::string bytes = SampleCase(2);
  ASSERT_OK_AND_ASSIGN(auto writer, store_->cases().Begin(CaseRecordOf(bytes), 100));
  ASSERT_THAT(writer->Write(0, bytes.substr(0, 300)), IsOk());
  EXPECT_TRUE(Found(bytes.substr(0, 100)));
  // As a killed process leaves it.
  std::filesystem::copy(path_, scratch_ / "killed", std::filesystem::copy_options::recursive);
  std::filesystem::permissions(scratch_ / "killed", std::filesystem::perms::owner_all);
  writer.reset();
  EXPECT_FALSE(Found(bytes.substr(0, 100)));
  const auto killed = DurableStore::Open(*DataFolder::Open(scratch_ / "killed"));
  ASSERT_THAT(killed.status(), IsOk());
  EXPECT_THAT((*killed)->damaged(), IsEmpty());
  const std::filesystem::directory_iterator files(scratch_ / "killed/blobs");
  EXPECT_EQ(std::distance(begin(files), end(files)), 1);
}

TEST_F(DurableCaseStoreTest, StartSetsDamagedCasesAsideAndAllowsSendingAgain) {
  const std::string flipped = Keep(1);
  const std::string gone = Keep(2);
  const std::string cut = Keep(3);
  const std::string row = Keep(4);
  Keep(5);
  store_.reset();
  Flip(flipped);
  std::filesystem::remove(Blob(gone));
  std::filesystem::resize_file(Blob(cut), 17);
  {
    ASSERT_OK_AND_ASSIGN(const auto database, Database::Open(path_ + "/tissueform.db"));
    ASSERT_THAT(database->Execute(absl::StrCat(
                    "UPDATE cases SET record = zeroblob(80) WHERE sha256 = '", row, "'")),
                IsOk());
  }
  Reopen();
  const std::set<std::string> expected = {
      absl::StrCat("case \"", flipped, "\""), absl::StrCat("case \"", gone, "\""),
      absl::StrCat("case \"", cut, "\""),     absl::StrCat("case \"", row, "\""),
      absl::StrCat("file ", flipped),         absl::StrCat("file ", cut)};
  EXPECT_EQ(Damaged(), expected);
  ExpectCase(5);
  for (const int number : {1, 2, 3, 4}) {
    Keep(number);
    ExpectCase(number);
  }
  Reopen();
  EXPECT_THAT(Damaged(), IsEmpty()) << "reported once";
}

TEST_F(DurableCaseStoreTest, CaseDamagedDuringServiceIsDetectedWhenRead) {
  const std::string flipped = Keep(1);
  const std::string gone = Keep(2);
  const std::string cut = Keep(3);
  Keep(4);
  Flip(flipped);
  std::filesystem::remove(Blob(gone));
  std::filesystem::resize_file(Blob(cut), 17);
  for (const std::string& name : {flipped, gone, cut}) {
    EXPECT_THAT(ReadWholeCase(store_->cases(), name), StatusIs(Code::kDataLoss));
    EXPECT_THAT(store_->cases().Find(SampleCaseKey(name)), StatusIs(Code::kNotFound));
  }
  EXPECT_TRUE(std::filesystem::exists(path_ + "/damaged/" + flipped));
  ExpectCase(4);
}

TEST_F(DurableCaseStoreTest, CaseTruncatedDuringAReadIsDataLoss) {
  const std::string name = Keep(1);
  ASSERT_OK_AND_ASSIGN(const auto reader, store_->cases().Open(SampleCaseKey(name), 0));
  ASSERT_THAT(reader->Read(0, 1000), IsOk());
  std::filesystem::resize_file(Blob(name), 1500);
  EXPECT_THAT(reader->Read(1000, 1000), StatusIs(Code::kDataLoss));
  EXPECT_THAT(store_->cases().Find(SampleCaseKey(name)), StatusIs(Code::kNotFound));
}

TEST_F(DurableCaseStoreTest, ADatabaseWithDamagedPagesKeepsItsReadableCases) {
  Keep(1);
  for (int number = 2; number < 60; ++number) {
    const std::string bytes = SampleCase(number, 10);
    ASSERT_THAT(KeepCase(store_->cases(), CaseRecordOf(bytes), bytes), IsOk());
  }
  store_.reset();
  const std::string file = path_ + "/tissueform.db";
  std::ifstream stream(file, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  constexpr size_t kPage = 4096;
  // The last page with rows of cases.
  const size_t at = bytes.rfind("head, from the right") / kPage * kPage;
  ASSERT_GT(at, kPage);
  std::fstream(file, std::ios::in | std::ios::out | std::ios::binary)
          .seekp(static_cast<std::streamoff>(at))
      << std::string(kPage, '\x55');
  Reopen();
  ASSERT_FALSE(store_->damaged().empty());
  EXPECT_EQ(store_->damaged()[0].what, "the database");
  ASSERT_OK_AND_ASSIGN(const CaseStore::Page page, store_->cases().List({.limit = 1000}));
  EXPECT_GT(page.records.size(), 20U);
  EXPECT_LT(page.records.size(), 59U);
  for (const CaseRecord& record : page.records) {
    EXPECT_THAT(ReadWholeCase(store_->cases(), record.sha256), IsOk());
  }
}

TEST_F(DurableCaseStoreTest, NothingIsAcknowledgedInAFolderThatIsGone) {
  Keep(1);
  std::filesystem::remove_all(path_);
  const std::string bytes = SampleCase(2);
  EXPECT_FALSE(KeepCase(store_->cases(), CaseRecordOf(bytes), bytes).ok());
}

}  // namespace
}  // namespace tissueform
