// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <memory>
#include <set>
#include <string>
#include <utility>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "server/store/access_queries.h"
#include "server/store/sql_access_store.h"
#include "tests/server/store/store_samples.h"
#include "tests/server/store/stores_case.h"
#include "tests/server/store/waiting_calls.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::StatusIs;

constexpr int64_t kNow = 1'000;
constexpr int kMost = 2;

ShareRow ShareWith(const std::string& principal, ShareRole role = ShareRole::kPlanner) {
  return {.resource = "sessions/a", .owner = "ann", .principal = principal, .role = role};
}

FollowLinkRow LinkOf(const std::string& digest, int64_t expires_s = 4711) {
  return {.digest = digest,
          .session = "a",
          .maker = "ann",
          .case_sha256 = std::string(64, 'c'),
          .expires_s = expires_s};
}

// What SqlAccessStore does with every driver.
class AccessStoreContractTest : public ::testing::TestWithParam<StoresCase> {
 protected:
  // Of a mesh that is stored, as a database wants it.
  void MakeSession(const std::string& id) {
    const MeshPayload mesh = SamplePayload(1);
    ASSERT_THAT(stores_->meshes().Put(RecordOf(mesh), mesh.View()), IsOk());
    SessionRecord record = SampleSession(id, 1);
    record.owner = "ann";
    ASSERT_THAT(CreateSession(stores_->sessions(), record), IsOk());
  }
  bool IsLink(const std::string& digest) { return (*queries_.FindLink(digest)).has_value(); }

  const std::unique_ptr<Stores> stores_ = GetParam().make(SystemUnixSeconds);
  SqlAccessStore store_{&stores_->database()};
  AccessQueries queries_{&stores_->database()};
};

TEST_P(AccessStoreContractTest, AShareNeedsAResourceOfItsOwnerButForProjects) {
  EXPECT_THAT(store_.PutShare(ShareWith("bob"), kMost), StatusIs(absl::StatusCode::kNotFound));
  MakeSession("a");
  ShareRow of_bob = ShareWith("cid");
  of_bob.owner = "bob";
  EXPECT_THAT(store_.PutShare(of_bob, kMost), StatusIs(absl::StatusCode::kNotFound));
  for (const char* resource : {"predictions/a", "cases/a"}) {
    ShareRow other = ShareWith("bob");
    other.resource = resource;
    EXPECT_THAT(store_.PutShare(other, kMost), StatusIs(absl::StatusCode::kNotFound)) << resource;
  }
  EXPECT_THAT(store_.PutShare(ShareWith("bob"), kMost), IsOk());
  ShareRow project = ShareWith("bob");
  project.resource = "projects/not yet";
  EXPECT_THAT(store_.PutShare(project, kMost), IsOk());
  EXPECT_THAT(*store_.SharesOf("ann", "sessions/a"), ElementsAre(ShareWith("bob")));
  EXPECT_THAT(*store_.SharesOf("ann", project.resource), ElementsAre(project));
  EXPECT_THAT(*store_.SharesOf("bob", "sessions/a"), IsEmpty());
}

TEST_P(AccessStoreContractTest, PredictionsAndCasesAreSharedByTheirOwners) {
  PredictionRecord prediction = SamplePrediction("p");
  prediction.owner = "ann";
  ASSERT_THAT(stores_->predictions().Create(prediction, SamplePositions(1)), IsOk());
  CaseRecord of_ann = CaseRecordOf("a case");
  of_ann.owner = "ann";
  ASSERT_THAT(KeepCase(stores_->cases(), of_ann, "a case"), IsOk());
  for (const std::string& resource : {std::string("predictions/p"), "cases/" + of_ann.sha256}) {
    ShareRow share = ShareWith("bob");
    share.resource = resource;
    EXPECT_THAT(store_.PutShare(share, kMost), IsOk()) << resource;
    share.owner = "bob";
    EXPECT_THAT(store_.PutShare(share, kMost), StatusIs(absl::StatusCode::kNotFound)) << resource;
  }
}

TEST_P(AccessStoreContractTest, LastRoleCountsAndSharesOfAResourceAreLimited) {
  MakeSession("a");
  ASSERT_THAT(store_.PutShare(ShareWith("bob", ShareRole::kViewer), kMost), IsOk());
  ASSERT_THAT(store_.PutShare(ShareWith("ann lee"), kMost), IsOk());
  const absl::Status full = store_.PutShare(ShareWith("dan"), kMost);
  EXPECT_TRUE(HasNoRoom(full)) << full;
  EXPECT_THAT(store_.PutShare(ShareWith("bob"), kMost), IsOk()) << "not one more";
  EXPECT_THAT(*store_.SharesOf("ann", "sessions/a"),
              ElementsAre(ShareWith("ann lee"), ShareWith("bob")));
}

TEST_P(AccessStoreContractTest, AShareIsErasedByItsKeyAndNothingElse) {
  MakeSession("a");
  ASSERT_THAT(store_.PutShare(ShareWith("bob"), kMost), IsOk());
  ASSERT_THAT(store_.PutShare(ShareWith("cid"), kMost), IsOk());
  EXPECT_THAT(store_.EraseShare(ShareWith("bob", ShareRole::kViewer)), IsOk());
  EXPECT_THAT(store_.EraseShare(ShareWith("bob")), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_THAT(*store_.SharesOf("ann", "sessions/a"), ElementsAre(ShareWith("cid")));
}

TEST_P(AccessStoreContractTest, ALinkNeedsItsSessionAndRoom) {
  EXPECT_THAT(store_.PutLink(LinkOf("d"), kNow, kMost), StatusIs(absl::StatusCode::kNotFound));
  MakeSession("a");
  ASSERT_THAT(store_.PutLink(LinkOf("d"), kNow, kMost), IsOk());
  ASSERT_THAT(store_.PutLink(LinkOf("e", kNow + 1), kNow, kMost), IsOk());
  const absl::Status full = store_.PutLink(LinkOf("f"), kNow, kMost);
  EXPECT_TRUE(HasNoRoom(full)) << full;
  EXPECT_TRUE(IsLink("e"));
  EXPECT_THAT(store_.PutLink(LinkOf("f"), kNow + 1, kMost), IsOk()) << "the expired one went";
  EXPECT_FALSE(IsLink("e"));
  EXPECT_EQ((*queries_.FindLink("f"))->link, LinkOf("f"));
}

TEST_P(AccessStoreContractTest, AllLinksOfOneSessionAreErased) {
  MakeSession("a");
  MakeSession("b");
  FollowLinkRow other = LinkOf("e");
  other.session = "b";
  ASSERT_THAT(store_.PutLink(LinkOf("d"), kNow, kMost), IsOk());
  ASSERT_THAT(store_.PutLink(other, kNow, kMost), IsOk());
  EXPECT_THAT(store_.EraseLinks("a"), IsOk());
  EXPECT_FALSE(IsLink("d"));
  EXPECT_TRUE(IsLink("e"));
}

TEST_P(AccessStoreContractTest, ARightToAMeshIsKeptOnceAndErasedByWhomAndByMesh) {
  const std::string mesh(64, 'e');
  const auto senders = [&] { return queries_.FindMeshUse(mesh)->senders; };
  for (const int64_t bytes : {7, 12}) {
    ASSERT_THAT(store_.PutMeshRight({.principal = "ann", .sha256 = mesh, .bytes = bytes}), IsOk());
  }
  ASSERT_THAT(store_.PutMeshRight({.principal = "bob", .sha256 = mesh, .bytes = 12}), IsOk());
  EXPECT_EQ(queries_.HoldingsOf("ann")->bytes, 12);
  EXPECT_THAT(store_.EraseMeshRight("bob", std::string(64, 'f')), IsOk()) << "of another mesh";
  EXPECT_THAT(senders(), ElementsAre("ann", "bob"));
  EXPECT_THAT(store_.EraseMeshRight("bob", mesh), IsOk());
  EXPECT_THAT(senders(), ElementsAre("ann"));
  EXPECT_THAT(store_.EraseMeshRights(mesh), IsOk());
  EXPECT_THAT(senders(), IsEmpty());
}

TEST_P(AccessStoreContractTest, ADamagedRowGivesNothing) {
  MakeSession("a");
  ASSERT_THAT(store_.PutShare(ShareWith("bob"), kMost), IsOk());
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
  EXPECT_THAT(*store_.SharesOf("ann", "sessions/a"), IsEmpty());
}

INSTANTIATE_TEST_SUITE_P(Stores, AccessStoreContractTest, ::testing::ValuesIn(AllStores()),
                         [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace tissueform
