// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <future>
#include <memory>
#include <string>
#include <utility>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "server/store/sql_access_store.h"
#include "tests/server/store/stores_case.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::tissueform::testing::IsOk;

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

// What every AccessStore does.
class AccessStoreContractTest : public ::testing::TestWithParam<StoresCase> {
 protected:
  const std::unique_ptr<Stores> stores_ = GetParam().make(SystemUnixSeconds);
  const std::unique_ptr<AccessStore> store_ =
      std::make_unique<SqlAccessStore>(&stores_->database());
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

TEST_P(AccessStoreContractTest, ADamagedRowGivesNothing) {
  ASSERT_THAT(ChangeAndWait(store_.get(), {}, {.shares = {kShare}, .links = {kLink}}), IsOk());
  ASSERT_OK_AND_ASSIGN(const SqlRows rows,
                       ReadSql<SqlRows>(&stores_->database(), [](SqlTransaction& transaction) {
                         return transaction.Query("SELECT record FROM shares", {});
                       }));
  std::string record(rows.Text(0, 0));
  record.back() ^= 1;
  ASSERT_THAT(stores_->database().Run({.work =
                                           [&](SqlTransaction& transaction) {
                                             return transaction.Run("UPDATE shares SET record = $1",
                                                                    {SqlBytes{record}});
                                           }}),
              IsOk());
  ASSERT_OK_AND_ASSIGN(const AccessRows kept, store_->Load());
  EXPECT_THAT(kept.shares, IsEmpty());
  EXPECT_THAT(kept.links, ElementsAre(kLink));
}

INSTANTIATE_TEST_SUITE_P(Stores, AccessStoreContractTest, ::testing::ValuesIn(AllStores()),
                         [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace tissueform
