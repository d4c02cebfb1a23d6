// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cstdlib>
#include <filesystem>
#include <future>
#include <memory>
#include <string>
#include <utility>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "server/platform/storage/data_folder.h"
#include "server/platform/storage/database.h"
#include "server/store/access_store/access_store.h"
#include "server/store/durable_store.h"
#include "server/store/in_memory_stores.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

absl::Status ChangeAndWait(AccessStore* store, AccessRows erase, AccessRows put) {
  std::promise<absl::Status> answered;
  store->Change(std::move(erase), std::move(put),
                [&answered](const absl::Status& status) { answered.set_value(status); });
  return answered.get_future().get();
}

const ShareRow kShare = {
    .resource = "sessions/a", .owner = "ann", .principal = "bob", .role = ShareRole::kPlanner};
const FollowLinkRow kLink = {.digest = std::string(64, 'd'),
                             .session = "a",
                             .maker = "ann",
                             .case_sha256 = std::string(64, 'c'),
                             .expires_s = 4711};
const MeshRight kRight = {.principal = "ann", .sha256 = std::string(64, 'e'), .bytes = 12};

struct AccessStoreCase {
  std::string name;
  bool durable;
};

// What every AccessStore does.
class AccessStoreContractTest : public ::testing::TestWithParam<AccessStoreCase> {
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
    store_ = OpenAccessStore(stores_.get());
  }

  std::string folder_ = ::testing::TempDir() + "access-XXXXXX";
  std::unique_ptr<Stores> stores_;
  std::unique_ptr<AccessStore> store_;
};

TEST_P(AccessStoreContractTest, ThereIsNothingAtFirst) {
  ASSERT_OK_AND_ASSIGN(const AccessRows rows, store_->Load());
  EXPECT_THAT(rows.shares, IsEmpty());
  EXPECT_THAT(rows.links, IsEmpty());
  EXPECT_THAT(rows.mesh_rights, IsEmpty());
}

TEST_P(AccessStoreContractTest, WhatWasPutIsThereOnceAndAsItWasPutLast) {
  ShareRow viewer = kShare;
  viewer.role = ShareRole::kViewer;
  ASSERT_THAT(ChangeAndWait(store_.get(), {},
                            {.shares = {viewer}, .links = {kLink}, .mesh_rights = {kRight}}),
              IsOk());
  ASSERT_THAT(ChangeAndWait(store_.get(), {}, {.shares = {kShare}, .mesh_rights = {kRight}}),
              IsOk());
  ASSERT_OK_AND_ASSIGN(const AccessRows rows, store_->Load());
  EXPECT_THAT(rows.shares, ElementsAre(kShare));
  EXPECT_THAT(rows.links, ElementsAre(kLink));
  EXPECT_THAT(rows.mesh_rights, ElementsAre(kRight));
}

TEST_P(AccessStoreContractTest, WhatIsErasedGoesByItsKeyAndNothingElse) {
  ShareRow other = kShare;
  other.principal = "cid";
  ASSERT_THAT(ChangeAndWait(store_.get(), {},
                            {.shares = {kShare, other}, .links = {kLink}, .mesh_rights = {kRight}}),
              IsOk());
  ShareRow by_key = kShare;
  by_key.role = ShareRole::kViewer;
  ASSERT_THAT(ChangeAndWait(store_.get(),
                            {.shares = {by_key},
                             .links = {kLink},
                             .mesh_rights = {{.principal = "bob", .sha256 = kRight.sha256}}},
                            {}),
              IsOk());
  ASSERT_OK_AND_ASSIGN(const AccessRows rows, store_->Load());
  EXPECT_THAT(rows.shares, ElementsAre(other));
  EXPECT_THAT(rows.links, IsEmpty());
  EXPECT_THAT(rows.mesh_rights, ElementsAre(kRight)) << "another's right";
}

TEST_P(AccessStoreContractTest, WhatIsErasedAndPutAtOnceIsThere) {
  ASSERT_THAT(ChangeAndWait(store_.get(), {.shares = {kShare}}, {.shares = {kShare}}), IsOk());
  ASSERT_OK_AND_ASSIGN(const AccessRows rows, store_->Load());
  EXPECT_THAT(rows.shares, ElementsAre(kShare));
}

class DurableAccessStoreTest : public AccessStoreContractTest {};

TEST_P(DurableAccessStoreTest, ItHasItAfterARestartAndADamagedRowGivesNothing) {
  ASSERT_THAT(ChangeAndWait(store_.get(), {}, {.shares = {kShare}, .links = {kLink}}), IsOk());
  Open();
  ASSERT_OK_AND_ASSIGN(const AccessRows kept, store_->Load());
  EXPECT_THAT(kept.shares, ElementsAre(kShare));
  store_.reset();
  stores_.reset();
  {
    ASSERT_OK_AND_ASSIGN(const auto database, Database::Open(folder_ + "/data/tissueform.db"));
    ASSERT_THAT(database->Execute("UPDATE shares SET record = CAST(replace(CAST(record AS TEXT), "
                                  "'bob', 'cid') AS BLOB)"),
                IsOk());
  }
  Open();
  ASSERT_OK_AND_ASSIGN(const AccessRows rows, store_->Load());
  EXPECT_THAT(rows.shares, IsEmpty());
  EXPECT_THAT(rows.links, ElementsAre(kLink));
}

INSTANTIATE_TEST_SUITE_P(Stores, AccessStoreContractTest,
                         ::testing::Values(AccessStoreCase{"InMemory", false},
                                           AccessStoreCase{"Durable", true}),
                         [](const auto& of) { return of.param.name; });
INSTANTIATE_TEST_SUITE_P(Stores, DurableAccessStoreTest,
                         ::testing::Values(AccessStoreCase{"Durable", true}),
                         [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace tissueform::testing
