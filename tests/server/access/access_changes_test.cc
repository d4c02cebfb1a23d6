// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/access_changes.h"

#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/in_memory_stores.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::IsEmpty;
using ::testing::SizeIs;
using Code = absl::StatusCode;

const std::string kMesh(64, 'e');

class AccessChangesTest : public ::testing::Test {
 protected:
  void SetUp() override { AddSession("s", "ann"); }

  void AddSession(const std::string& id, const std::string& owner) {
    SessionRecord session;
    session.id = id;
    session.owner = owner;
    session.mesh_sha256 = kMesh;
    changes_.Added(session);
  }

  AccessChanges::Done Into(absl::Status* outcome) {
    return [outcome](const absl::Status& status) { *outcome = status; };
  }
  absl::Status Share(const Principal& caller, const std::string& resource, const std::string& with,
                     ShareRole role = ShareRole::kViewer) {
    absl::Status outcome;
    changes_.Share(caller, {.resource = resource, .principal = with, .role = role}, Into(&outcome));
    return outcome;
  }
  absl::Status Unshare(const Principal& caller, const std::string& resource,
                       const std::string& with) {
    absl::Status outcome;
    changes_.Unshare(caller, resource, with, Into(&outcome));
    return outcome;
  }
  absl::Status Link(const Principal& caller, const std::string& digest) {
    absl::Status outcome;
    changes_.AddLink(caller, {.digest = digest, .session = "s", .expires_s = now_s_ + 10},
                     Into(&outcome));
    return outcome;
  }

  const Principal ann_{.name = "ann"};
  const Principal bob_{.name = "bob"};
  int64_t now_s_ = 1000;
  InMemoryAccessStore store_;
  AccessQueries queries_{store_.database()};
  Access access_{&queries_, [this] { return now_s_; }};
  AccessChanges changes_{
      {.max_shares_per_resource = 2, .max_links_per_session = 2}, &store_, &access_};
};

TEST_F(AccessChangesTest, OnlyTheOwnerShares) {
  EXPECT_THAT(Share(bob_, "sessions/s", "bob"), StatusIs(Code::kNotFound));
  ASSERT_THAT(Share(ann_, "sessions/s", "bob", ShareRole::kPlanner), IsOk());
  EXPECT_THAT(Share(bob_, "sessions/s", "cid"), StatusIs(Code::kPermissionDenied));
  EXPECT_THAT(changes_.SharesOf(bob_, "sessions/s").status(), StatusIs(Code::kPermissionDenied));
  EXPECT_THAT(Unshare(bob_, "sessions/s", "bob"), StatusIs(Code::kPermissionDenied));
  EXPECT_THAT(*changes_.SharesOf(ann_, "sessions/s"), SizeIs(1));
}

TEST_F(AccessChangesTest, WhatIsNoNameIsRefused) {
  for (const char* resource :
       {"", "sessions", "session/s", "meshes/x", "projects/", "sessions/\n"}) {
    EXPECT_THAT(Share(ann_, resource, "bob"), StatusIs(Code::kInvalidArgument)) << resource;
  }
  EXPECT_THAT(Share(ann_, "sessions/s", ""), StatusIs(Code::kInvalidArgument));
  EXPECT_THAT(Share(ann_, "sessions/s", "b\tob"), StatusIs(Code::kInvalidArgument));
  EXPECT_THAT(Share(ann_, "sessions/s", std::string(129, 'b')), StatusIs(Code::kInvalidArgument));
  EXPECT_THAT(Share(ann_, "sessions/none", "bob"), StatusIs(Code::kNotFound));
}

TEST_F(AccessChangesTest, AShareThatIsTakenBackIsAwayAtOnce) {
  ASSERT_THAT(Share(ann_, "sessions/s", "bob", ShareRole::kPlanner), IsOk());
  EXPECT_THAT(access_.RecheckSessionAccess(bob_, "s", Permission::kWrite), IsOk());
  ASSERT_THAT(Unshare(ann_, "sessions/s", "bob"), IsOk());
  EXPECT_THAT(access_.CheckSessionAccess(bob_, "s", Permission::kRead), StatusIs(Code::kNotFound));
  EXPECT_THAT(access_.RecheckSessionAccess(bob_, "s", Permission::kRead),
              StatusIs(Code::kNotFound));
  EXPECT_THAT(store_.Load()->shares, IsEmpty());
  EXPECT_THAT(Unshare(ann_, "sessions/s", "bob"), StatusIs(Code::kNotFound));
}

TEST_F(AccessChangesTest, SharesAndLinksOfOneResourceAreBounded) {
  ASSERT_THAT(Share(ann_, "sessions/s", "a"), IsOk());
  ASSERT_THAT(Share(ann_, "sessions/s", "b"), IsOk());
  EXPECT_THAT(Share(ann_, "sessions/s", "c"), StatusIs(Code::kResourceExhausted));
  EXPECT_THAT(Share(ann_, "sessions/s", "b", ShareRole::kPlanner), IsOk()) << "no new one";
  ASSERT_THAT(Link(ann_, "1"), IsOk());
  ASSERT_THAT(Link(ann_, "2"), IsOk());
  EXPECT_THAT(Link(ann_, "3"), StatusIs(Code::kResourceExhausted));
  now_s_ += 10;
  EXPECT_THAT(Link(ann_, "3"), IsOk()) << "those that have ended make room";
  EXPECT_THAT(store_.Load()->links, SizeIs(1));
}

TEST_F(AccessChangesTest, ASessionTakesItsSharesAndLinksWithIt) {
  ASSERT_THAT(Share(ann_, "sessions/s", "bob"), IsOk());
  ASSERT_THAT(Link(ann_, "1"), IsOk());
  changes_.SessionRemoved("s");
  AddSession("s", "ann");
  EXPECT_THAT(access_.CheckSessionAccess(bob_, "s", Permission::kRead), StatusIs(Code::kNotFound));
  EXPECT_THAT(access_.FindLink("1").status(), StatusIs(Code::kUnauthenticated));
  EXPECT_THAT(store_.Load()->shares, IsEmpty());
  EXPECT_THAT(store_.Load()->links, IsEmpty());
}

TEST_F(AccessChangesTest, LinksAreTakenBackByWhoMayDrag) {
  ASSERT_THAT(Link(bob_, "1"), StatusIs(Code::kNotFound));
  ASSERT_THAT(Share(ann_, "sessions/s", "bob"), IsOk());
  ASSERT_THAT(Link(bob_, "1"), StatusIs(Code::kPermissionDenied));
  ASSERT_THAT(Link(ann_, "1"), IsOk());
  absl::Status outcome;
  changes_.RemoveLinks(bob_, "s", Into(&outcome));
  EXPECT_THAT(outcome, StatusIs(Code::kPermissionDenied));
  changes_.RemoveLinks(ann_, "s", Into(&outcome));
  EXPECT_THAT(outcome, IsOk());
  EXPECT_THAT(access_.FindLink("1").status(), StatusIs(Code::kUnauthenticated));
}

TEST_F(AccessChangesTest, WhatWasLearntCountsAfterARestart) {
  ASSERT_THAT(Share(ann_, "sessions/s", "bob"), IsOk());
  Access access(&queries_, [this] { return now_s_; });
  AccessChanges changes({}, &store_, &access);
  ASSERT_THAT(changes.LoadAll(), IsOk());
  SessionRecord session;
  session.id = "s";
  session.owner = "ann";
  changes.Added(session);
  EXPECT_THAT(access.CheckSessionAccess(bob_, "s", Permission::kRead), IsOk());
}

TEST_F(AccessChangesTest, AMeshIsOfWhoHasSentItUntilItGoes) {
  const std::string mesh(64, 'b');
  ASSERT_THAT(changes_.GrantMesh(bob_, mesh, 100), IsOk());
  EXPECT_THAT(access_.CheckMeshAccess(bob_, mesh, Permission::kOwner), IsOk());
  EXPECT_THAT(access_.CheckMeshAccess(ann_, mesh, Permission::kRead), StatusIs(Code::kNotFound));
  EXPECT_FALSE(access_.OthersHoldMesh(bob_, mesh));
  ASSERT_THAT(changes_.GrantMesh(ann_, mesh, 100), IsOk());
  EXPECT_TRUE(access_.OthersHoldMesh(bob_, mesh));
  ASSERT_THAT(changes_.ReleaseMesh(ann_, mesh), IsOk());
  EXPECT_FALSE(access_.OthersHoldMesh(bob_, mesh));
  changes_.MeshRemoved(mesh);
  EXPECT_THAT(access_.CheckMeshAccess(bob_, mesh, Permission::kRead), StatusIs(Code::kNotFound));
  EXPECT_THAT(store_.Load()->mesh_rights, IsEmpty());
}

// Answers a change when the test says so; something may happen between its reading and its answer.
class HeldAccessStore final : public AccessStore {
 public:
  absl::StatusOr<AccessRows> Load() override {
    absl::StatusOr<AccessRows> rows = store_.Load();
    if (after_reading_) std::exchange(after_reading_, nullptr)();
    return rows;
  }
  void Change(AccessRows erase, AccessRows put, std::function<void(absl::Status)> done) override {
    auto change = [this, erase = std::move(erase), put = std::move(put), done = std::move(done)] {
      store_.Change(erase, put, done);
    };
    if (holds_) {
      held_.push_back(std::move(change));
    } else {
      change();
    }
  }

  void Hold() { holds_ = true; }
  void Release() {
    holds_ = false;
    for (const auto& change : std::exchange(held_, {})) change();
  }
  void AfterReading(std::function<void()> then) { after_reading_ = std::move(then); }
  InMemoryAccessStore& rows() { return store_; }

 private:
  InMemoryAccessStore store_;
  bool holds_ = false;
  std::vector<std::function<void()>> held_;
  std::function<void()> after_reading_;
};

class FollowingAccessChangesTest : public ::testing::Test {
 protected:
  void SetUp() override {
    changes_.EnableClusterMode();
    SessionRecord session;
    session.id = "s";
    session.owner = "ann";
    changes_.Added(session);
  }

  void Share() {
    changes_.Share(ann_, share_, [](const absl::Status& status) { EXPECT_THAT(status, IsOk()); });
  }
  void Link(const std::string& digest) {
    changes_.AddLink(
        ann_, {.digest = digest, .session = "s", .expires_s = std::numeric_limits<int64_t>::max()},
        [](const absl::Status& status) { EXPECT_THAT(status, IsOk()); });
  }
  bool BobMayLook() { return access_.CheckSessionAccess(bob_, "s", Permission::kRead).ok(); }

  const Principal ann_{.name = "ann"};
  const Principal bob_{.name = "bob"};
  const ShareRow share_{.resource = "sessions/s", .owner = "ann", .principal = "bob"};
  HeldAccessStore store_;
  AccessQueries queries_{store_.rows().database()};
  Access access_{&queries_};
  AccessChanges changes_{{}, &store_, &access_};
};

TEST_F(FollowingAccessChangesTest, WhatOthersGiveAndTakeIsLearnt) {
  store_.rows().Change({}, {.shares = {share_}}, [](const absl::Status&) {});
  EXPECT_FALSE(BobMayLook());
  ASSERT_THAT(changes_.ReloadRows(), IsOk());
  EXPECT_TRUE(BobMayLook());
  store_.rows().Change({.shares = {share_}}, {}, [](const absl::Status&) {});
  ASSERT_THAT(changes_.ReloadRows(), IsOk());
  EXPECT_FALSE(BobMayLook());
  changes_.SessionGone("s");
  EXPECT_THAT(access_.CheckSessionAccess(ann_, "s", Permission::kRead), StatusIs(Code::kNotFound));
}

TEST_F(FollowingAccessChangesTest, WhatIsBeingTakenAwayDoesNotComeBackMeanwhile) {
  Share();
  store_.Hold();
  changes_.Unshare(ann_, "sessions/s", "bob", [](const absl::Status&) {});
  EXPECT_FALSE(BobMayLook());
  ASSERT_THAT(changes_.ReloadRows(), IsOk());
  EXPECT_FALSE(BobMayLook()) << "though the store has it still";
  store_.Release();
  ASSERT_THAT(changes_.ReloadRows(), IsOk());
  EXPECT_FALSE(BobMayLook());
  ASSERT_THAT(changes_.ReloadRows(), IsOk());
  Share();
  EXPECT_TRUE(BobMayLook()) << "and it may be given again";
}

TEST_F(FollowingAccessChangesTest, WhatIsGivenWhileAllIsReadStays) {
  store_.AfterReading([this] { Share(); });
  ASSERT_THAT(changes_.ReloadRows(), IsOk());
  EXPECT_TRUE(BobMayLook());
}

TEST_F(FollowingAccessChangesTest, WhatOneServerGivesWhileAnotherDeletesTheSessionOpensNoNextOne) {
  Access access_there(&queries_);
  AccessChanges there({}, &store_.rows(), &access_there);
  const auto add = [](AccessChanges* changes) {
    SessionRecord session;
    session.id = "s";
    session.owner = "ann";
    changes->Added(session);
  };
  add(&there);
  there.SessionRemoved("s");
  // Its notice has not come yet.
  Link("1");
  Share();
  store_.Hold();
  Link("2");
  changes_.SessionGone("s");
  store_.Release();  // the link is put there, then the rows that were known are erased
  EXPECT_THAT(store_.Load()->links, IsEmpty());
  EXPECT_THAT(store_.Load()->shares, IsEmpty());
  add(&there);
  ASSERT_THAT(there.ReloadRows(), IsOk());
  add(&changes_);
  ASSERT_THAT(changes_.ReloadRows(), IsOk());
  for (const char* digest : {"1", "2"}) {
    EXPECT_THAT(access_there.FindLink(digest).status(), StatusIs(Code::kUnauthenticated));
    EXPECT_THAT(access_.FindLink(digest).status(), StatusIs(Code::kUnauthenticated));
  }
  EXPECT_FALSE(BobMayLook());
}

// Has the session "t" of ann's and a link to it, "l"; does not answer for "away".
class ShownRows final : public RowReader {
 public:
  absl::StatusOr<FoundRows> ReadRow(const RowName& row) override {
    asked.push_back(row);
    if (row.name == "away") return absl::UnavailableError("the store is away");
    FoundRows found;
    if (row.name == "l") {
      found.access.links = {{.digest = "l",
                             .session = "t",
                             .maker = "ann",
                             .expires_s = std::numeric_limits<int64_t>::max()}};
    } else if (row.name != "t") {
      return found;
    }
    found.session.emplace();
    found.session->id = "t";
    found.session->owner = "ann";
    return found;
  }

  std::vector<RowName> asked;
};

TEST_F(FollowingAccessChangesTest, WhatACallNamesAndNobodyKnowsIsLookedForBeforeItIsRefused) {
  ShownRows rows;
  access_.set_row_reader(&rows);
  const std::vector<RowName>& asked = rows.asked;
  EXPECT_THAT(access_.CheckSessionAccess(ann_, "t", Permission::kOwner), IsOk());
  EXPECT_THAT(access_.CheckSessionAccess(ann_, "t", Permission::kOwner), IsOk());
  EXPECT_THAT(access_.CheckSessionAccess(bob_, "s", Permission::kRead), StatusIs(Code::kNotFound));
  EXPECT_THAT(asked, SizeIs(1)) << "what is known is not looked for";
  EXPECT_THAT(access_.CheckPredictionAccess(ann_, "p", Permission::kRead),
              StatusIs(Code::kNotFound));
  EXPECT_THAT(access_.CheckCaseAccess(ann_, kMesh, Permission::kRead).status(),
              StatusIs(Code::kNotFound));
  EXPECT_THAT(access_.CheckMeshAccess(ann_, kMesh, Permission::kRead), StatusIs(Code::kNotFound));
  EXPECT_THAT(access_.FindLink(kMesh).status(), StatusIs(Code::kUnauthenticated));
  ASSERT_THAT(asked, SizeIs(5));
  EXPECT_EQ(asked[2].owner, "ann") << "a case is somebody's";
  EXPECT_THAT(access_.CheckSessionAccess(ann_, "away", Permission::kRead),
              StatusIs(Code::kUnavailable))
      << "nobody knows that it is not there";
}

TEST_F(FollowingAccessChangesTest, ALinkThatIsFoundWhileAllIsReadStaysAndIsNotLookedForAgain) {
  ShownRows rows;
  access_.set_row_reader(&rows);
  EXPECT_THAT(access_.RecheckLink("l"), StatusIs(Code::kUnauthenticated));
  EXPECT_THAT(rows.asked, IsEmpty()) << "a call that lasts does not wait for the store";
  store_.AfterReading([this] { EXPECT_THAT(access_.FindLink("l"), IsOk()); });
  ASSERT_THAT(changes_.ReloadRows(), IsOk());
  EXPECT_THAT(access_.RecheckLink("l"), IsOk());
  EXPECT_THAT(rows.asked, SizeIs(1));
  ASSERT_THAT(changes_.ReloadRows(), IsOk());
  EXPECT_THAT(access_.RecheckLink("l"), StatusIs(Code::kUnauthenticated)) << "it was taken back";
}

}  // namespace
}  // namespace tissueform::testing
