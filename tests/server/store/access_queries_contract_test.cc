// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
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
using ::testing::SizeIs;
using ::tissueform::testing::IsOk;

constexpr int kMost = 100;

// What is kept, in plain maps: the reference. It says by plain loops what the queries must say.
struct World {
  struct SessionRow {
    std::string owner;
    std::string project;
    std::string mesh;
  };
  struct Prediction {
    std::string owner;
    std::string session;
    std::string mesh;
  };
  std::map<std::string, SessionRow> sessions;
  std::map<std::string, Prediction> predictions;
  std::map<CaseKey, std::string> cases;  // their projects
  std::map<std::string, ShareRow> shares;
  std::map<std::string, std::set<std::string>> senders;  // by mesh

  // Whether the owner has what a share names.
  bool Has(const std::string& owner, const std::string& resource) const {
    for (const auto& [id, row] : sessions) {
      if (row.owner == owner && resource == "sessions/" + id) return true;
    }
    for (const auto& [id, row] : predictions) {
      if (row.owner == owner && resource == "predictions/" + id) return true;
    }
    for (const auto& [key, project] : cases) {
      if (key.owner == owner && resource == "cases/" + key.sha256) return true;
    }
    return resource.starts_with("projects/");
  }

  std::optional<ShareRole> Role(const std::string& owner, const std::string& resource,
                                const std::string& project, const std::string& to) const {
    std::optional<ShareRole> role;
    for (const auto& [key, share] : shares) {
      const bool of_project = !project.empty() && share.resource == "projects/" + project;
      if (share.owner == owner && share.principal == to &&
          (share.resource == resource || of_project)) {
        role = std::max(role, std::optional<ShareRole>(share.role));
      }
    }
    return role;
  }
  std::optional<ShareRole> SessionRole(const std::string& id, const std::string& to) const {
    const SessionRow& row = sessions.at(id);
    return Role(row.owner, "sessions/" + id, row.project, to);
  }
  // Of the session that a prediction was made in.
  bool IsSessionShared(const Prediction& row, const std::string& to) const {
    const auto session = sessions.find(row.session);
    return session != sessions.end() && session->second.owner == row.owner &&
           SessionRole(row.session, to).has_value();
  }
  bool IsPredictionShared(const std::string& id, const std::string& to) const {
    const Prediction& row = predictions.at(id);
    return Role(row.owner, "predictions/" + id, "", to).has_value() || IsSessionShared(row, to);
  }
  bool IsMeshShown(const std::string& mesh, const std::string& to) const {
    for (const auto& [id, row] : sessions) {
      if (row.mesh == mesh && (row.owner == to || SessionRole(id, to).has_value())) return true;
    }
    for (const auto& [id, row] : predictions) {
      if (row.mesh == mesh && (row.owner == to || IsPredictionShared(id, to))) return true;
    }
    return false;
  }
};

class AccessQueriesTest : public ::testing::TestWithParam<StoresCase> {
 protected:
  // Sessions are made from meshes that are stored.
  void SetUp() override {
    for (const int number : {1, 2}) {
      const MeshPayload payload = SamplePayload(number);
      const MeshRecord record = RecordOf(payload);
      ASSERT_THAT(stores_->meshes().Put(record, payload.View()), IsOk());
      meshes_.push_back(record.sha256);
    }
  }

  void AddSession(const std::string& id, const std::string& owner, const std::string& project,
                  const std::string& mesh) {
    SessionRecord record = SampleSession(id, 1);
    record.owner = owner;
    record.project = project;
    record.mesh_sha256 = mesh;
    ASSERT_THAT(CreateSession(stores_->sessions(), record), IsOk());
    world_.sessions[id] = {owner, project, mesh};
  }
  void Delete(const std::string& id) {
    ASSERT_THAT(DeleteSession(stores_->sessions(), id), IsOk());
    const std::string owner = world_.sessions.at(id).owner;
    std::erase_if(world_.shares, [&](const auto& entry) {
      return entry.second.owner == owner && entry.second.resource == "sessions/" + id;
    });
    world_.sessions.erase(id);
  }
  void AddPrediction(const std::string& id, const std::string& owner, const std::string& session,
                     const std::string& mesh) {
    PredictionRecord record;
    record.id = id;
    record.owner = owner;
    record.session = session;
    record.mesh_sha256 = mesh;
    record.vertex_count = 1;
    record.metadata = "m";
    ASSERT_THAT(stores_->predictions().Create(record, std::string(12, '\0')), IsOk());
    world_.predictions[id] = {owner, session, mesh};
  }
  void AddCase(const std::string& bytes, const std::string& owner, const std::string& project) {
    CaseRecord record = CaseRecordOf(bytes);
    record.owner = owner;
    record.project = project;
    ASSERT_THAT(KeepCase(stores_->cases(), record, bytes), IsOk());
    world_.cases[record.key()] = project;
  }
  void Share(const std::string& owner, const std::string& resource, const std::string& to,
             ShareRole role = ShareRole::kViewer) {
    const ShareRow share = {.resource = resource, .owner = owner, .principal = to, .role = role};
    const absl::Status status = access_.PutShare(share, kMost);
    if (!world_.Has(owner, resource)) {
      EXPECT_TRUE(absl::IsNotFound(status)) << status;
      return;
    }
    ASSERT_THAT(status, IsOk());
    world_.shares[KeyOf(share)] = share;
  }
  void Send(const std::string& mesh, const std::string& by) {
    ASSERT_THAT(access_.PutMeshRight({.principal = by, .sha256 = mesh, .bytes = 7}), IsOk());
    world_.senders[mesh].insert(by);
  }

  void CheckSessions(const std::string& who) {
    std::set<std::string> shared;
    for (const auto& [id, row] : world_.sessions) {
      ASSERT_OK_AND_ASSIGN(const auto found, queries_.FindSession(id, who));
      ASSERT_TRUE(found.has_value()) << id;
      EXPECT_EQ(found->owner, row.owner);
      EXPECT_EQ(found->mesh_sha256, row.mesh);
      EXPECT_EQ(found->role, world_.SessionRole(id, who)) << id << " for " << who;
      if (found->role.has_value() && row.owner != who) shared.insert(id);
    }
    EXPECT_EQ(*queries_.SharedSessions(who), shared) << who;
  }
  void CheckPredictions(const std::string& who) {
    std::set<std::string> shared;
    for (const auto& [id, row] : world_.predictions) {
      ASSERT_OK_AND_ASSIGN(const auto found, queries_.FindPrediction(id, who));
      ASSERT_TRUE(found.has_value()) << id;
      EXPECT_EQ(found->owner, row.owner);
      EXPECT_EQ(found->role, world_.Role(row.owner, "predictions/" + id, "", who)) << id;
      const bool by_session = found->session.has_value() && found->session->role.has_value();
      EXPECT_EQ(by_session, world_.IsSessionShared(row, who)) << id << " for " << who;
      if (world_.IsPredictionShared(id, who) && row.owner != who) shared.insert(id);
    }
    EXPECT_EQ(*queries_.SharedPredictions(who), shared) << who;
  }
  void CheckCases(const std::string& who) {
    std::set<CaseKey> shared;
    for (const auto& [key, project] : world_.cases) {
      ASSERT_OK_AND_ASSIGN(const auto found, queries_.FindCases(key.sha256, who));
      const auto at = std::ranges::find(found, key, &CaseGrant::key);
      ASSERT_NE(at, found.end()) << key.owner;
      const auto role = world_.Role(key.owner, "cases/" + key.sha256, project, who);
      EXPECT_EQ(at->role, role) << key.owner << " for " << who;
      if (role.has_value()) shared.insert(key);
    }
    EXPECT_EQ(*queries_.SharedCases(who), shared) << who;
  }
  void CheckMesh(const std::string& mesh, const std::string& who) {
    ASSERT_OK_AND_ASSIGN(const bool shown, queries_.IsMeshShown(mesh, who));
    EXPECT_EQ(shown, world_.IsMeshShown(mesh, who)) << mesh << " for " << who;
    ASSERT_OK_AND_ASSIGN(const MeshUse use, queries_.FindMeshUse(mesh));
    EXPECT_EQ(use.senders, world_.senders[mesh]);
    const bool sent = use.senders.contains(who);
    EXPECT_EQ(queries_.MeshesNear(who)->contains(mesh), shown || sent) << mesh << " for " << who;
  }

  const std::unique_ptr<Stores> stores_ = GetParam().make(SystemUnixSeconds);
  AccessQueries queries_{&stores_->database()};
  SqlAccessStore access_{&stores_->database()};
  World world_;
  std::vector<std::string> meshes_;  // their names
};

TEST_P(AccessQueriesTest, MatchPlainLoopsOverAllRows) {
  const std::vector<std::string> people = {"ann", "bob", "cid", ""};
  const std::vector<std::string> projects = {"", "p", "r"};
  std::mt19937 random(20261127);
  const auto any = [&random](const auto& of) {
    return of[std::uniform_int_distribution<size_t>(0, of.size() - 1)(random)];
  };
  for (int i = 0; i < 12; ++i) {
    const std::string id = absl::StrCat("s", i);
    AddSession(id, any(people), any(projects), any(meshes_));
    AddPrediction(absl::StrCat("q", i), any(people), absl::StrCat("s", i / 2), any(meshes_));
    AddCase(absl::StrCat("case ", i / 3), absl::StrCat("owner", i % 3), any(projects));
    Send(any(meshes_), any(people));
  }
  std::vector<std::string> resources = {"projects/p", "projects/r"};
  for (const auto& [id, row] : world_.sessions) resources.push_back("sessions/" + id);
  for (const auto& [id, row] : world_.predictions) resources.push_back("predictions/" + id);
  for (const auto& [key, project] : world_.cases) resources.push_back("cases/" + key.sha256);
  const std::vector<std::string> owners = {"ann", "bob", "cid", "owner0", "owner1", "owner2"};
  for (int i = 0; i < 600; ++i) {
    Share(any(owners), any(resources), any(std::vector<std::string>{"ann", "bob", "cid"}),
          i % 2 == 0 ? ShareRole::kViewer : ShareRole::kPlanner);
  }
  ASSERT_GT(world_.shares.size(), 50U) << "of the random shares too few were possible";
  for (const char* id : {"s1", "s4"}) Delete(id);
  for (const char* who : {"ann", "bob", "cid", "nobody"}) {
    CheckSessions(who);
    CheckPredictions(who);
    CheckCases(who);
    for (const std::string& mesh : meshes_) CheckMesh(mesh, who);
  }
}

TEST_P(AccessQueriesTest, FindNothingInAnEmptyStore) {
  EXPECT_FALSE(queries_.FindSession("s", "ann")->has_value());
  EXPECT_FALSE(queries_.FindPrediction("q", "ann")->has_value());
  EXPECT_THAT(*queries_.FindCases(meshes_[0], "ann"), IsEmpty());
  EXPECT_FALSE(queries_.FindLink("d")->has_value());
  EXPECT_THAT(*queries_.LinksOf("s"), IsEmpty());
  EXPECT_FALSE(*queries_.IsMeshShown(meshes_[0], "ann"));
  EXPECT_THAT(*queries_.HoldingsByOwner(), IsEmpty());
  EXPECT_EQ(queries_.HoldingsOf("ann")->bytes, 0);
}

TEST_P(AccessQueriesTest, LinkComesWithTheRightsOfItsCreator) {
  AddSession("s", "ann", "p", meshes_[0]);
  Share("ann", "projects/p", "bob", ShareRole::kPlanner);
  const FollowLinkRow link = {.digest = "d", .session = "s", .maker = "bob", .expires_s = 100};
  ASSERT_THAT(access_.PutLink(link, /*now_s=*/0, kMost), IsOk());
  ASSERT_OK_AND_ASSIGN(const std::optional<LinkGrant> found, queries_.FindLink("d"));
  ASSERT_TRUE(found.has_value());
  EXPECT_EQ(found->link, link);
  ASSERT_TRUE(found->maker.has_value());
  EXPECT_EQ(found->maker->owner, "ann");
  EXPECT_EQ(found->maker->role, ShareRole::kPlanner);
  EXPECT_THAT(*queries_.LinksOf("s"), SizeIs(1));
  ASSERT_THAT(access_.EraseShare({.resource = "projects/p", .owner = "ann", .principal = "bob"}),
              IsOk());
  EXPECT_EQ((*queries_.FindLink("d"))->maker->role, std::nullopt);
}

// The next resource of the name starts with no rights.
TEST_P(AccessQueriesTest, DeletingAResourceDeletesItsRightsInOneTransaction) {
  const std::string bytes = "the bytes of a case";
  const CaseKey key = {.sha256 = CaseRecordOf(bytes).sha256, .owner = "ann"};
  const auto add = [&] {
    AddSession("s", "ann", "", meshes_[0]);
    AddPrediction("q", "ann", "other", meshes_[0]);
    AddCase(bytes, "ann", "");
  };
  add();
  Share("ann", "sessions/s", "bob");
  Share("ann", "predictions/q", "bob");
  Share("ann", "cases/" + key.sha256, "bob");
  const FollowLinkRow link = {.digest = "d", .session = "s", .maker = "ann", .expires_s = 100};
  ASSERT_THAT(access_.PutLink(link, /*now_s=*/0, kMost), IsOk());
  Delete("s");
  ASSERT_THAT(stores_->predictions().Delete("q"), IsOk());
  ASSERT_THAT(stores_->cases().Delete(key), IsOk());
  add();
  EXPECT_EQ((*queries_.FindSession("s", "bob"))->role, std::nullopt);
  EXPECT_EQ((*queries_.FindPrediction("q", "bob"))->role, std::nullopt);
  EXPECT_EQ((*queries_.FindCases(key.sha256, "bob")).front().role, std::nullopt);
  EXPECT_FALSE(queries_.FindLink("d")->has_value());
}

TEST_P(AccessQueriesTest, HoldingsAreThoseOfSessionsPredictionsCasesAndMeshes) {
  AddSession("s", "ann", "", meshes_[0]);
  AddPrediction("q", "ann", "s", meshes_[0]);  // 12 bytes of positions and 1 of notes
  AddCase("12345", "ann", "");
  Send(meshes_[0], "ann");  // 7 bytes
  Send(meshes_[0], "bob");
  EXPECT_EQ(queries_.HoldingsOf("ann")->sessions, 1);
  EXPECT_EQ(queries_.HoldingsOf("ann")->bytes, 13 + 5 + 7);
  ASSERT_OK_AND_ASSIGN(const auto all, queries_.HoldingsByOwner());
  EXPECT_THAT(all, SizeIs(2));
  EXPECT_EQ(all.at("ann").bytes, 13 + 5 + 7);
  EXPECT_EQ(all.at("ann").sessions, 1);
  EXPECT_EQ(all.at("bob").bytes, 7);
  EXPECT_THAT(*queries_.PredictionsOfMesh(meshes_[0]), ElementsAre("q"));
  EXPECT_THAT(*queries_.OwnersOfPredictions({"q", "none"}), ElementsAre("ann"));
  EXPECT_THAT(queries_.FindMeshUse(meshes_[0])->sessions, ElementsAre(std::pair("ann", 1)));
}

TEST_P(AccessQueriesTest, ADamagedShareGivesNothing) {
  AddSession("s", "ann", "", meshes_[0]);
  Share("ann", "sessions/s", "bob");
  ASSERT_THAT(stores_->database().Run({.work =
                                           [](SqlTransaction& transaction) {
                                             return transaction.Run("UPDATE shares SET record = $1",
                                                                    {SqlBytes{"no sealed bytes"}});
                                           }}),
              IsOk());
  EXPECT_EQ((*queries_.FindSession("s", "bob"))->role, std::nullopt);
  EXPECT_THAT(*queries_.SharedSessions("bob"), IsEmpty());
  EXPECT_FALSE(*queries_.IsMeshShown(meshes_[0], "bob"));
}

INSTANTIATE_TEST_SUITE_P(Stores, AccessQueriesTest, ::testing::ValuesIn(AllStores()),
                         [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace tissueform
