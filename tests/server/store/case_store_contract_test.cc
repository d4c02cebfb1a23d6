// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "server/store/case_store.h"
#include "tests/server/store/store_samples.h"
#include "tests/server/store/stores_case.h"
#include "tests/testing/status_matchers.h"

// What every case store must do.
namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::StatusIs;
using Code = absl::StatusCode;

MATCHER_P(Holds, value, "") {
  *result_listener << tissueform::testing::GetStatus(arg).ToString();
  return arg.ok() && *arg == value;
}

class CaseStoreContractTest : public ::testing::TestWithParam<StoresCase> {
 protected:
  // Keeps a case and returns its name.
  std::string Keep(int number, int64_t last_used_s = 1000, const std::string& owner = "planner") {
    const std::string bytes = SampleCase(number);
    CaseRecord record = CaseRecordOf(bytes);
    record.last_used_s = last_used_s;
    record.owner = owner;
    EXPECT_THAT(KeepCase(*store_, record, bytes), IsOk());
    return record.sha256;
  }
  std::vector<std::string> Names() {
    std::vector<std::string> names;
    const absl::StatusOr<CaseStore::Page> page = store_->List({});
    EXPECT_THAT(page, IsOk());
    for (const CaseRecord& record : page->records) names.push_back(record.sha256);
    return names;
  }

  const std::unique_ptr<Stores> stores_ = GetParam().make(SystemUnixSeconds);
  CaseStore* const store_ = &stores_->cases();
};

TEST_P(CaseStoreContractTest, ACaseIsFoundAndReadAsItWas) {
  const std::string bytes = SampleCase(1);
  const CaseRecord record = CaseRecordOf(bytes);
  ASSERT_OK_AND_ASSIGN(const CaseRecord kept, KeepCase(*store_, record, bytes));
  EXPECT_EQ(kept.sha256, record.sha256);
  ASSERT_OK_AND_ASSIGN(const CaseRecord found, store_->Find(SampleCaseKey(record.sha256)));
  EXPECT_EQ(found.sha256, record.sha256);
  EXPECT_EQ(found.owner, record.owner);
  EXPECT_EQ(found.title, record.title);
  EXPECT_EQ(found.total_bytes, record.total_bytes);
  EXPECT_EQ(found.created_s, record.created_s);
  EXPECT_EQ(found.last_used_s, record.last_used_s);
  EXPECT_THAT(ReadWholeCase(*store_, record.sha256), Holds(bytes));
}

TEST_P(CaseStoreContractTest, AnyPartOfItIsRead) {
  const std::string name = Keep(1);
  const std::string bytes = SampleCase(1);
  ASSERT_OK_AND_ASSIGN(const auto reader, store_->Open(SampleCaseKey(name), 0));
  EXPECT_EQ(reader->total_bytes(), static_cast<int64_t>(bytes.size()));
  EXPECT_EQ(*reader->Read(4000, 17), bytes.substr(4000, 17));
  EXPECT_EQ(*reader->Read(10, 100), bytes.substr(10, 100));
  EXPECT_EQ(*reader->Read(4900, 4096), bytes.substr(4900));
  EXPECT_EQ(*reader->Read(5000, 1), "");
}

TEST_P(CaseStoreContractTest, MissingCaseIsNotFound) {
  const std::string name(64, 'a');
  for (const std::string& missing : {name, std::string("../../etc/passwd")}) {
    EXPECT_THAT(store_->Find(SampleCaseKey(missing)),
                StatusIs(Code::kNotFound, HasSubstr(missing)));
    EXPECT_THAT(store_->Open(SampleCaseKey(missing), 0).status(), StatusIs(Code::kNotFound));
    EXPECT_THAT(store_->Delete(SampleCaseKey(missing)), StatusIs(Code::kNotFound));
    EXPECT_THAT(store_->Touch(SampleCaseKey(missing), 5), IsOk());
  }
}

TEST_P(CaseStoreContractTest, RefusesInvalidCasesAndKeepsNothing) {
  const std::string bytes = SampleCase(1);
  const auto refused = [&](auto change, Code code) {
    CaseRecord record = CaseRecordOf(bytes);
    change(record);
    EXPECT_THAT(KeepCase(*store_, record, bytes), StatusIs(code));
  };
  refused([](CaseRecord& record) { record.sha256 = "../../somewhere"; }, Code::kInvalidArgument);
  refused([](CaseRecord& record) { record.total_bytes = 0; }, Code::kInvalidArgument);
  refused([](CaseRecord& record) { record.total_bytes = -7; }, Code::kInvalidArgument);
  refused([](CaseRecord& record) { ++record.total_bytes; }, Code::kInvalidArgument);
  refused([](CaseRecord& record) { --record.total_bytes; }, Code::kInvalidArgument);
  refused([](CaseRecord& record) { record.sha256[3] = record.sha256[3] == 'a' ? 'b' : 'a'; },
          Code::kDataLoss);
  EXPECT_THAT(Names(), IsEmpty());
}

TEST_P(CaseStoreContractTest, BytesFollowEachOther) {
  const std::string bytes = SampleCase(1);
  ASSERT_OK_AND_ASSIGN(const auto writer, store_->Begin(CaseRecordOf(bytes), 100));
  ASSERT_THAT(writer->Write(0, bytes.substr(0, 10)), IsOk());
  EXPECT_THAT(writer->Write(11, "x"), StatusIs(Code::kInvalidArgument, HasSubstr("10 bytes")));
  EXPECT_THAT(writer->Write(0, "x"), StatusIs(Code::kInvalidArgument));
  EXPECT_THAT(writer->Write(-1, "x"), StatusIs(Code::kInvalidArgument));
}

TEST_P(CaseStoreContractTest, UnfinishedCaseLeavesNothing) {
  const std::string bytes = SampleCase(1);
  {
    ASSERT_OK_AND_ASSIGN(const auto writer, store_->Begin(CaseRecordOf(bytes), 100));
    ASSERT_THAT(writer->Write(0, bytes), IsOk());
  }
  EXPECT_THAT(Names(), IsEmpty());
  EXPECT_THAT(KeepCase(*store_, CaseRecordOf(bytes), bytes), IsOk());
}

TEST_P(CaseStoreContractTest, TheSameCaseAgainIsKeptOnceAsItWasFirst) {
  const std::string bytes = SampleCase(1);
  CaseRecord record = CaseRecordOf(bytes);
  ASSERT_THAT(KeepCase(*store_, record, bytes), IsOk());
  record.title = "another";
  record.last_used_s = 2000;
  ASSERT_OK_AND_ASSIGN(CaseRecord kept, KeepCase(*store_, record, bytes));
  EXPECT_EQ(kept.title, CaseRecordOf(bytes).title);
  EXPECT_EQ(kept.last_used_s, 2000);
  record.last_used_s = 500;
  ASSERT_OK_AND_ASSIGN(kept, KeepCase(*store_, record, bytes));
  EXPECT_EQ(kept.last_used_s, 2000) << "never goes back";
  EXPECT_THAT(Names(), ElementsAre(record.sha256));
  EXPECT_THAT(store_->Delete(SampleCaseKey(record.sha256)), IsOk());
  EXPECT_THAT(store_->Open(SampleCaseKey(record.sha256), 0).status(), StatusIs(Code::kNotFound));
}

TEST_P(CaseStoreContractTest, LimitsTheNumberOfCases) {
  const std::string first = SampleCase(1);
  const std::string second = SampleCase(2);
  // Both begin where there is room for one.
  ASSERT_OK_AND_ASSIGN(const auto a, store_->Begin(CaseRecordOf(first), 1));
  ASSERT_OK_AND_ASSIGN(const auto b, store_->Begin(CaseRecordOf(second), 1));
  ASSERT_THAT(a->Write(0, first), IsOk());
  ASSERT_THAT(b->Write(0, second), IsOk());
  EXPECT_THAT(a->Finish(), IsOk());
  EXPECT_THAT(b->Finish(), StatusIs(Code::kResourceExhausted, HasSubstr("max_cases")));
  EXPECT_THAT(store_->Begin(CaseRecordOf(second), 1).status(),
              StatusIs(Code::kResourceExhausted, HasSubstr("max_cases")));
  EXPECT_THAT(Names(), ElementsAre(CaseRecordOf(first).sha256));
  ASSERT_THAT(store_->Delete(SampleCaseKey(CaseRecordOf(first).sha256)), IsOk());
  EXPECT_THAT(KeepCase(*store_, CaseRecordOf(second), second, 1), IsOk());
}

TEST_P(CaseStoreContractTest, ReaderContinuesAfterItsCaseIsDeleted) {
  const std::string name = Keep(1);
  ASSERT_OK_AND_ASSIGN(const auto reader, store_->Open(SampleCaseKey(name), 0));
  ASSERT_THAT(store_->Delete(SampleCaseKey(name)), IsOk());
  EXPECT_THAT(reader->Read(0, 5000), Holds(SampleCase(1)));
}

TEST_P(CaseStoreContractTest, ListsThoseOfAnOwnerByNamePageAfterPage) {
  std::vector<std::string> names;
  names.reserve(5);
  for (int number = 0; number < 5; ++number) names.push_back(Keep(number));
  std::sort(names.begin(), names.end());
  const std::string others = Keep(5, 1000, "");
  std::vector<std::string> found;
  CaseStore::ListRequest request{.owner = "planner", .limit = 2};
  do {
    ASSERT_OK_AND_ASSIGN(const CaseStore::Page page, store_->List(request));
    EXPECT_LE(page.records.size(), 2);
    for (const CaseRecord& record : page.records) found.push_back(record.sha256);
    request.after = page.next;
  } while (!request.after.empty());
  EXPECT_EQ(found, names);
  ASSERT_OK_AND_ASSIGN(const CaseStore::Page page, store_->List({.owner = ""}));
  ASSERT_EQ(page.records.size(), 1U);
  EXPECT_EQ(page.records[0].sha256, others);
  EXPECT_EQ(Names().size(), 6U);
  EXPECT_THAT(store_->List({.limit = 0}), StatusIs(Code::kInvalidArgument));
}

TEST_P(CaseStoreContractTest, EveryOwnerHasACaseOfTheSameFile) {
  const std::string name = Keep(1, 1000, "planner");
  ASSERT_EQ(Keep(1, 1001, "another"), name);
  ASSERT_OK_AND_ASSIGN(const CaseRecord mine, store_->Find({name, "planner"}));
  ASSERT_OK_AND_ASSIGN(const CaseRecord theirs, store_->Find({name, "another"}));
  EXPECT_EQ(mine.owner, "planner");
  EXPECT_EQ(theirs.owner, "another");
  EXPECT_EQ(mine.last_used_s, 1000);
  ASSERT_THAT(store_->Delete({name, "planner"}), IsOk());
  EXPECT_THAT(store_->Find({name, "planner"}), StatusIs(Code::kNotFound));
  EXPECT_THAT(store_->Open({name, "another"}, 1002), IsOk()) << "its file stays";
  ASSERT_THAT(store_->Delete({name, "another"}), IsOk());
  EXPECT_THAT(store_->Open({name, "another"}, 1002).status(), StatusIs(Code::kNotFound));
}

TEST_P(CaseStoreContractTest, APageMayHoldNamedCasesOfOthers) {
  const std::string mine = Keep(1, 1000, "planner");
  const std::string shared = Keep(2, 1000, "o\"ther");
  const std::string hidden = Keep(3, 1000, "o\"ther");
  std::vector<std::string> names = {mine, shared};
  std::sort(names.begin(), names.end());
  std::vector<std::string> found;
  CaseStore::ListRequest request{
      .owner = "planner", .also = {{shared, "o\"ther"}}, .after = "", .limit = 1};
  do {
    ASSERT_OK_AND_ASSIGN(const CaseStore::Page page, store_->List(request));
    for (const CaseRecord& record : page.records) found.push_back(record.sha256);
    request.after = page.next;
  } while (!request.after.empty());
  EXPECT_EQ(found, names);
}

TEST_P(CaseStoreContractTest, RemovesUnusedCasesOldestFirstExceptSparedOnes) {
  const std::string a = Keep(1, 1000);
  const std::string b = Keep(2, 900);
  const std::string c = Keep(3, 800);
  const std::string d = Keep(4, 700);
  EXPECT_THAT(store_->RemoveUnused(1000, {d}, 1), Holds(std::vector<CaseKey>{SampleCaseKey(c)}));
  EXPECT_THAT(store_->Find(SampleCaseKey(c)), StatusIs(Code::kNotFound))
      << "the oldest that is not spared";
  ASSERT_THAT(store_->Open(SampleCaseKey(b), 1500).status(), IsOk());
  EXPECT_THAT(store_->RemoveUnused(1001, {}, 10),
              Holds(std::vector<CaseKey>{SampleCaseKey(d), SampleCaseKey(a)}));
  EXPECT_THAT(Names(), ElementsAre(b)) << "opening is a use";
  EXPECT_THAT(store_->Find(SampleCaseKey(a)), StatusIs(Code::kNotFound));
}

TEST_P(CaseStoreContractTest, KeepingAndDeletingOneCaseAtOnceLeavesItWholeOrGone) {
  const std::string bytes = SampleCase(1);
  const CaseRecord record = CaseRecordOf(bytes);
  std::vector<std::thread> threads;
  threads.reserve(4);
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&, i] {
      for (int round = 0; round < 15; ++round) {
        if (i % 2 == 0) {
          EXPECT_THAT(KeepCase(*store_, record, bytes), IsOk());
        } else {
          const absl::Status status = store_->Delete(SampleCaseKey(record.sha256));
          EXPECT_TRUE(status.ok() || absl::IsNotFound(status)) << status;
        }
        const absl::StatusOr<std::string> read = ReadWholeCase(*store_, record.sha256);
        EXPECT_TRUE(read.ok() ? *read == bytes : absl::IsNotFound(read.status())) << read.status();
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  ASSERT_THAT(KeepCase(*store_, record, bytes), IsOk());
  EXPECT_THAT(ReadWholeCase(*store_, record.sha256), Holds(bytes));
}

INSTANTIATE_TEST_SUITE_P(Stores, CaseStoreContractTest, ::testing::ValuesIn(AllStores()),
                         [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace tissueform
