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

#include "tests/server/store/waiting_calls.h"
#include "tests/testing/in_memory_stores.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::ElementsAre;
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
    ASSERT_THAT(CreateSession(store_.stores->sessions(), session), IsOk());
  }

  absl::Status Share(const Principal& caller, const std::string& resource, const std::string& with,
                     ShareRole role = ShareRole::kViewer) {
    return changes_.Share(caller, {.resource = resource, .principal = with, .role = role});
  }
  absl::Status Link(const Principal& caller, const std::string& digest) {
    return changes_.AddLink(caller, {.digest = digest, .session = "s", .expires_s = now_s_ + 10});
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
  EXPECT_THAT(changes_.Unshare(bob_, "sessions/s", "bob"), StatusIs(Code::kPermissionDenied));
  EXPECT_THAT(*changes_.SharesOf(ann_, "sessions/s"), SizeIs(1));
}

TEST_F(AccessChangesTest, RefusesInvalidNames) {
  for (const char* resource :
       {"", "sessions", "session/s", "meshes/x", "projects/", "sessions/\n"}) {
    EXPECT_THAT(Share(ann_, resource, "bob"), StatusIs(Code::kInvalidArgument)) << resource;
  }
  EXPECT_THAT(Share(ann_, "sessions/s", ""), StatusIs(Code::kInvalidArgument));
  EXPECT_THAT(Share(ann_, "sessions/s", "b\tob"), StatusIs(Code::kInvalidArgument));
  EXPECT_THAT(Share(ann_, "sessions/s", std::string(129, 'b')), StatusIs(Code::kInvalidArgument));
  EXPECT_THAT(Share(ann_, "sessions/none", "bob"), StatusIs(Code::kNotFound));
}

TEST_F(AccessChangesTest, RemovedShareIsGoneAtOnce) {
  ASSERT_THAT(Share(ann_, "sessions/s", "bob", ShareRole::kPlanner), IsOk());
  EXPECT_THAT(access_.RecheckSessionAccess(bob_, "s", Permission::kWrite), IsOk());
  ASSERT_THAT(changes_.Unshare(ann_, "sessions/s", "bob"), IsOk());
  EXPECT_THAT(access_.CheckSessionAccess(bob_, "s", Permission::kRead), StatusIs(Code::kNotFound));
  EXPECT_THAT(access_.RecheckSessionAccess(bob_, "s", Permission::kRead),
              StatusIs(Code::kNotFound));
  EXPECT_THAT(changes_.Unshare(ann_, "sessions/s", "bob"), StatusIs(Code::kNotFound));
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
  EXPECT_THAT(*queries_.LinksOf("s"), SizeIs(1));
}

TEST_F(AccessChangesTest, ASessionTakesItsSharesAndLinksWithIt) {
  ASSERT_THAT(Share(ann_, "sessions/s", "bob"), IsOk());
  ASSERT_THAT(Link(ann_, "1"), IsOk());
  ASSERT_THAT(DeleteSession(store_.stores->sessions(), "s"), IsOk());
  access_.ForgetLinks();
  AddSession("s", "ann");
  EXPECT_THAT(access_.CheckSessionAccess(bob_, "s", Permission::kRead), StatusIs(Code::kNotFound));
  EXPECT_THAT(access_.FindLink("1").status(), StatusIs(Code::kUnauthenticated));
}

TEST_F(AccessChangesTest, OnlyPrincipalsWhoMayDragCanRevokeLinks) {
  ASSERT_THAT(Link(bob_, "1"), StatusIs(Code::kNotFound));
  ASSERT_THAT(Share(ann_, "sessions/s", "bob"), IsOk());
  ASSERT_THAT(Link(bob_, "1"), StatusIs(Code::kPermissionDenied));
  ASSERT_THAT(Link(ann_, "1"), IsOk());
  EXPECT_THAT(changes_.RemoveLinks(bob_, "s"), StatusIs(Code::kPermissionDenied));
  EXPECT_THAT(changes_.RemoveLinks(ann_, "s"), IsOk());
  EXPECT_THAT(access_.FindLink("1").status(), StatusIs(Code::kUnauthenticated));
}

TEST_F(AccessChangesTest, MeshBelongsToItsSendersUntilItIsRemoved) {
  const std::string mesh(64, 'b');
  ASSERT_THAT(changes_.GrantMesh(bob_, mesh, 100), IsOk());
  EXPECT_THAT(access_.CheckMeshAccess(bob_, mesh, Permission::kOwner), IsOk());
  EXPECT_THAT(access_.CheckMeshAccess(ann_, mesh, Permission::kRead), StatusIs(Code::kNotFound));
  EXPECT_THAT(access_.FindMeshUse(mesh)->senders, ElementsAre("bob"));
  ASSERT_THAT(changes_.GrantMesh(ann_, mesh, 100), IsOk());
  EXPECT_THAT(access_.FindMeshUse(mesh)->senders, ElementsAre("ann", "bob"));
  ASSERT_THAT(changes_.ReleaseMesh(ann_, mesh), IsOk());
  EXPECT_THAT(access_.FindMeshUse(mesh)->senders, ElementsAre("bob"));
  changes_.MeshRemoved(mesh);
  EXPECT_THAT(access_.CheckMeshAccess(bob_, mesh, Permission::kRead), StatusIs(Code::kNotFound));
}

}  // namespace
}  // namespace tissueform::testing
