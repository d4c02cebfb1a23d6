// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <memory>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "server/exports/export_store.h"
#include "server/store/stores.h"
#include "tests/server/store/stores_case.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::StatusIs;

ExportRecord SampleExport(const std::string& id) {
  return {.id = id,
          .prediction = "p",
          .case_sha256 = std::string(64, 'c'),
          .owner = "ann",
          .state = ExportState::kStoring,
          .detail = "3 of 6",
          .stored_objects = 3,
          .created_s = 4711,
          .updated_s = 4712,
          .version = 1,
          .request_key = std::string(64, 'k'),
          .request_fingerprint = std::string(64, 'f'),
          .measures = std::string("a\0b", 3)};
}

// What every ExportStore does.
class ExportStoreContractTest : public ::testing::TestWithParam<StoresCase> {
 protected:
  const std::unique_ptr<Stores> stores_ = GetParam().make(SystemUnixSeconds);
  const std::unique_ptr<ExportStore> store_ =
      std::make_unique<SqlExportStore>(&stores_->database());
};

TEST_P(ExportStoreContractTest, ThereIsNothingAtFirst) {
  ASSERT_OK_AND_ASSIGN(const auto kept, store_->Load());
  EXPECT_THAT(kept, IsEmpty());
  EXPECT_THAT(store_->Erase({"none"}), IsOk());
}

TEST_P(ExportStoreContractTest, LoadsTheLastPutRecordsInOrder) {
  ASSERT_THAT(store_->Put(SampleExport("b")), IsOk());
  ASSERT_THAT(store_->Put(SampleExport("a")), IsOk());
  ExportRecord later = SampleExport("b");
  later.state = ExportState::kStored;
  later.version = 2;
  ASSERT_THAT(store_->Put(later), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto kept, store_->Load());
  EXPECT_THAT(kept, ElementsAre(SampleExport("a"), later));
}

TEST_P(ExportStoreContractTest, DoesNotOverwriteAChangeOfAnotherServer) {
  SqlExportStore there(&stores_->database());
  ExportRecord record = SampleExport("a");
  ASSERT_THAT(store_->Put(record), IsOk());
  EXPECT_THAT(store_->Put(record), IsOk()) << "as after a commit whose answer was lost";
  record.version = 2;
  record.detail = "there";
  ASSERT_THAT(there.Put(record), IsOk());
  EXPECT_THAT(there.Put(record), IsOk());
  record.detail = "here";
  EXPECT_THAT(store_->Put(record), StatusIs(absl::StatusCode::kAborted));
  ASSERT_THAT(there.Erase({"a"}), IsOk());
  record.version = 3;
  EXPECT_THAT(store_->Put(record), StatusIs(absl::StatusCode::kAborted))
      << "what is gone does not come back";
}

TEST_P(ExportStoreContractTest, ErasesOnlyTheGivenExports) {
  for (const char* id : {"a", "b", "c"}) ASSERT_THAT(store_->Put(SampleExport(id)), IsOk());
  ASSERT_THAT(store_->Erase({"a", "none", "c"}), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto kept, store_->Load());
  EXPECT_THAT(kept, ElementsAre(SampleExport("b")));
}

TEST_P(ExportStoreContractTest, ADamagedRowIsPassedOver) {
  for (const char* id : {"a", "b"}) ASSERT_THAT(store_->Put(SampleExport(id)), IsOk());
  ASSERT_THAT(stores_->database().Run({.work =
                                           [](SqlTransaction& transaction) {
                                             return transaction.Run(
                                                 "UPDATE exports SET record = $1 WHERE name = $2",
                                                 {SqlBytes{"damaged"}, "a"});
                                           }}),
              IsOk());
  ASSERT_OK_AND_ASSIGN(const auto kept, store_->Load());
  EXPECT_THAT(kept, ElementsAre(SampleExport("b")));
}

INSTANTIATE_TEST_SUITE_P(Stores, ExportStoreContractTest, ::testing::ValuesIn(AllStores()),
                         [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace tissueform
