// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "server/exports/export_store.h"
#include "server/platform/storage/data_folder.h"
#include "server/platform/storage/database.h"
#include "server/store/durable_store.h"
#include "server/store/in_memory_stores.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

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
          .version = 7,
          .request_key = std::string(64, 'k'),
          .request_fingerprint = std::string(64, 'f'),
          .measures = std::string("a\0b", 3)};
}

struct ExportStoreCase {
  std::string name;
  bool durable;
};

// What every ExportStore does.
class ExportStoreContractTest : public ::testing::TestWithParam<ExportStoreCase> {
 protected:
  void SetUp() override {
    ASSERT_NE(mkdtemp(folder_.data()), nullptr);
    Open();
  }
  void TearDown() override {
    store_.reset();
    stores_.reset();
    std::filesystem::remove_all(folder_);
  }

  void Open() {
    store_.reset();
    stores_.reset();
    stores_ = GetParam().durable ? *DurableStore::Open(*DataFolder::Open(folder_ + "/data"))
                                 : *OpenInMemoryStores();
    store_ = OpenExportStore(stores_.get());
  }

  std::string folder_ = ::testing::TempDir() + "exports-XXXXXX";
  std::unique_ptr<Stores> stores_;
  std::unique_ptr<ExportStore> store_;
};

TEST_P(ExportStoreContractTest, ThereIsNothingAtFirst) {
  ASSERT_OK_AND_ASSIGN(const auto kept, store_->Load());
  EXPECT_THAT(kept, IsEmpty());
  EXPECT_THAT(store_->Erase({"none"}), IsOk());
}

TEST_P(ExportStoreContractTest, WhatWasPutIsThereAsItWasPutLastAndInOrder) {
  ExportRecord before = SampleExport("b");
  before.state = ExportState::kWaiting;
  ASSERT_THAT(store_->Put(before), IsOk());
  ASSERT_THAT(store_->Put(SampleExport("a")), IsOk());
  ASSERT_THAT(store_->Put(SampleExport("b")), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto kept, store_->Load());
  EXPECT_THAT(kept, ElementsAre(SampleExport("a"), SampleExport("b")));
}

TEST_P(ExportStoreContractTest, WhatIsErasedGoesAndNothingElse) {
  for (const char* id : {"a", "b", "c"}) ASSERT_THAT(store_->Put(SampleExport(id)), IsOk());
  ASSERT_THAT(store_->Erase({"a", "none", "c"}), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto kept, store_->Load());
  EXPECT_THAT(kept, ElementsAre(SampleExport("b")));
}

class DurableExportStoreTest : public ExportStoreContractTest {};

TEST_P(DurableExportStoreTest, ItHasItAfterARestartWithoutADamagedRow) {
  for (const char* id : {"a", "b"}) ASSERT_THAT(store_->Put(SampleExport(id)), IsOk());
  store_.reset();
  stores_.reset();
  {
    ASSERT_OK_AND_ASSIGN(const auto database, Database::Open(folder_ + "/data/tissueform.db"));
    ASSERT_THAT(database->Execute("UPDATE exports SET record = zeroblob(9) WHERE name = 'a'"),
                IsOk());
  }
  Open();
  ASSERT_OK_AND_ASSIGN(const auto kept, store_->Load());
  EXPECT_THAT(kept, ElementsAre(SampleExport("b")));
}

INSTANTIATE_TEST_SUITE_P(Stores, ExportStoreContractTest,
                         ::testing::Values(ExportStoreCase{"InMemory", false},
                                           ExportStoreCase{"Durable", true}),
                         [](const auto& of) { return of.param.name; });
INSTANTIATE_TEST_SUITE_P(Stores, DurableExportStoreTest,
                         ::testing::Values(ExportStoreCase{"Durable", true}),
                         [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace tissueform::testing
