// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/access.h"

#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <utility>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "server/access/access_changes.h"
#include "server/exports/export_queue.h"
#include "server/exports/export_store.h"
#include "server/store/access_queries.h"
#include "server/store/sql_access_store.h"
#include "server/store/sql_stores.h"
#include "tests/server/store/store_samples.h"
#include "tests/server/store/waiting_calls.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using Code = absl::StatusCode;

const std::string kMesh(64, 'e');
const std::string kCaseBytes = "the bytes of a case";
const std::string kCase = CaseRecordOf(kCaseBytes).sha256;

// A database that can be away.
class AwayDatabase final : public SqlDatabase {
 public:
  explicit AwayDatabase(SqlDatabase* database) : database_(*database) {}

  void set_away(bool away) { away_ = away; }
  int asked() const { return asked_; }

  absl::Status Run(const SqlJob& job) override {
    ++asked_;
    return away_ ? absl::UnavailableError("away") : database_.Run(job);
  }
  void Submit(const std::string& key, SqlJob job, StatusCallback done) override {
    database_.Submit(key, std::move(job), std::move(done));
  }
  void Peek(const std::string& key, SqlJob job, StatusCallback done) override {
    database_.Peek(key, std::move(job), std::move(done));
  }
  bool shared() const override { return true; }
  const DurationHistogram* latency() const override { return nullptr; }

 private:
  SqlDatabase& database_;
  bool away_ = false;
  int asked_ = 0;
};

// Ann has a session, a prediction of it and a case, all in one project but the prediction; no
// other user has anything.
class AccessTest : public ::testing::Test {
 protected:
  void SetUp() override {
    SessionRecord session;
    session.id = "s";
    session.owner = ann_.name;
    session.project = "p";
    session.mesh_sha256 = kMesh;
    Add(session);
    PredictionRecord prediction;
    prediction.id = "q";
    prediction.owner = ann_.name;
    prediction.session = "s";
    prediction.mesh_sha256 = kMesh;
    prediction.case_sha256 = kCase;
    Add(prediction);
    AddCase(ann_.name, "p");
  }

  // Into the store and into what is known.
  void Add(const SessionRecord& record) {
    ASSERT_THAT(CreateSession(stores_->sessions(), record), IsOk());
  }
  void Add(const PredictionRecord& record) {
    ASSERT_THAT(stores_->predictions().Create(record, ""), IsOk());
  }
  void AddCase(const std::string& owner, const std::string& project) {
    CaseRecord record = CaseRecordOf(kCaseBytes);
    record.owner = owner;
    record.project = project;
    ASSERT_THAT(KeepCase(stores_->cases(), record, kCaseBytes), IsOk());
  }

  void Export(const std::string& prediction) {
    ASSERT_THAT(exports_.Create({.prediction = prediction, .case_sha256 = kCase}), IsOk());
  }
  absl::Status Share(const std::string& resource, const std::string& with,
                     ShareRole role = ShareRole::kViewer) {
    return changes_.Share(ann_, {.resource = resource, .principal = with, .role = role});
  }

  const Principal ann_{.name = "ann"};
  const Principal bob_{.name = "bob"};
  const Principal nobody_ = {};
  int64_t now_s_ = 1000;
  std::unique_ptr<Stores> stores_ = *OpenInMemoryStores();
  SqlAccessStore store_{&stores_->database()};
  AccessQueries queries_{&stores_->database()};
  std::unique_ptr<ExportStore> export_store_ =
      std::make_unique<SqlExportStore>(&stores_->database());
  ExportQueue exports_{{}, export_store_.get()};
  Access access_{&queries_, [this] { return now_s_; }, &exports_};
  AccessChanges changes_{{}, &store_, &access_};
};

TEST_F(AccessTest, BridgeSeesOnlyTheContentsOfExports) {
  const Principal bridge{.name = "bridge", .roles = {"bridge"}};
  const auto looks = [&](const Principal& caller) {
    return access_.CheckPredictionAccess(caller, "q", Permission::kRead).ok() &&
           access_.CheckCaseAccess(caller, kCase, Permission::kRead).ok() &&
           access_.CheckMeshAccess(caller, kMesh, Permission::kRead).ok();
  };
  EXPECT_THAT(access_.CheckPredictionAccess(bridge, "q", Permission::kRead),
              StatusIs(Code::kNotFound));
  EXPECT_THAT(access_.CheckCaseAccess(bridge, kCase, Permission::kRead), StatusIs(Code::kNotFound));
  EXPECT_THAT(access_.CheckMeshAccess(bridge, kMesh, Permission::kRead), StatusIs(Code::kNotFound));
  Export("q");
  EXPECT_TRUE(looks(bridge));
  EXPECT_FALSE(looks(bob_));
  EXPECT_THAT(access_.CheckPredictionAccess(bridge, "q", Permission::kOwner),
              StatusIs(Code::kPermissionDenied));
  EXPECT_THAT(access_.CheckSessionAccess(bridge, "s", Permission::kRead),
              StatusIs(Code::kNotFound));
  EXPECT_THAT(*access_.SharedPredictions(bridge), ElementsAre("q"));
  ASSERT_EQ(access_.SharedCases(bridge)->size(), 1U);
  ASSERT_THAT(exports_.RemoveOf("q"), IsOk());
  EXPECT_FALSE(looks(bridge));
  EXPECT_THAT(*access_.SharedPredictions(bridge), IsEmpty());
  Export("q");
  ASSERT_THAT(stores_->predictions().Delete("q"), IsOk());
  EXPECT_THAT(access_.CheckCaseAccess(bridge, kCase, Permission::kRead), StatusIs(Code::kNotFound));
}

// Whose prediction it is must be let look at the case.
TEST_F(AccessTest, ExportOfAForeignCaseDoesNotRevealItToABridge) {
  const Principal bridge{.name = "bridge", .roles = {"bridge"}};
  PredictionRecord foreign;
  foreign.id = "b";
  foreign.owner = bob_.name;
  foreign.case_sha256 = kCase;
  Add(foreign);
  Export("b");
  EXPECT_THAT(access_.CheckPredictionAccess(bridge, "b", Permission::kRead), IsOk());
  EXPECT_THAT(access_.CheckCaseAccess(bridge, kCase, Permission::kRead), StatusIs(Code::kNotFound));
  ASSERT_THAT(Share("cases/" + kCase, "bob"), IsOk());
  EXPECT_THAT(access_.CheckCaseAccess(bridge, kCase, Permission::kRead), IsOk());
}

TEST_F(AccessTest, OnlyBridgesMayUpdateExports) {
  const Principal bridge{.name = "bridge", .roles = {"bridge"}};
  EXPECT_THAT(Access::CheckMethodAccess(bridge, "ExportService.UpdateExport"), IsOk());
  EXPECT_THAT(Access::CheckMethodAccess(nobody_, "ExportService.UpdateExport"), IsOk());
  EXPECT_THAT(Access::CheckMethodAccess(ann_, "ExportService.UpdateExport"),
              StatusIs(Code::kPermissionDenied));
  EXPECT_EQ(Access::ExportsSeenBy(bridge), std::nullopt);
  EXPECT_EQ(Access::ExportsSeenBy(ann_), "ann");
  const absl::Status none = absl::NotFoundError("none");
  EXPECT_THAT(Access::CheckExportAccess(ann_, "ann", none, Permission::kOwner), IsOk());
  EXPECT_THAT(Access::CheckExportAccess(bridge, "ann", none, Permission::kRead), IsOk());
  EXPECT_THAT(Access::CheckExportAccess(bridge, "ann", none, Permission::kOwner),
              StatusIs(Code::kPermissionDenied));
  EXPECT_EQ(Access::CheckExportAccess(bob_, "ann", none, Permission::kRead), none);
}

TEST_F(AccessTest, OwnersHaveFullAccess) {
  EXPECT_THAT(access_.CheckSessionAccess(ann_, "s", Permission::kOwner), IsOk());
  EXPECT_THAT(access_.CheckPredictionAccess(ann_, "q", Permission::kOwner), IsOk());
  EXPECT_THAT(access_.CheckCaseAccess(ann_, kCase, Permission::kOwner), IsOk());
  EXPECT_THAT(access_.CheckMeshAccess(ann_, kMesh, Permission::kRead), IsOk());
}

TEST_F(AccessTest, ForeignResourcesLookLikeMissingOnes) {
  const std::string none(64, 'f');
  const auto same_but_for_the_name = [](const absl::Status& foreign, const absl::Status& missing,
                                        const std::string& name, const std::string& other) {
    std::string message(foreign.message());
    for (size_t at = 0; (at = message.find(name, at)) != std::string::npos; at += other.size()) {
      message.replace(at, name.size(), other);
    }
    return foreign.code() == Code::kNotFound && missing.code() == Code::kNotFound &&
           message == missing.message();
  };
  for (const Permission need : {Permission::kRead, Permission::kWrite, Permission::kOwner}) {
    EXPECT_EQ(access_.CheckSessionAccess(bob_, "s", need).status().code(), Code::kNotFound);
    EXPECT_EQ(access_.CheckPredictionAccess(bob_, "q", need).status().code(), Code::kNotFound);
    EXPECT_TRUE(same_but_for_the_name(access_.CheckCaseAccess(bob_, kCase, need).status(),
                                      access_.CheckCaseAccess(bob_, none, need).status(), kCase,
                                      none));
    EXPECT_TRUE(same_but_for_the_name(access_.CheckMeshAccess(bob_, kMesh, need),
                                      access_.CheckMeshAccess(bob_, none, need), kMesh, none));
  }
}

TEST_F(AccessTest, AnonymousCallersSeeNoOwnedResources) {
  EXPECT_THAT(access_.CheckSessionAccess(nobody_, "s", Permission::kRead),
              StatusIs(Code::kNotFound));
  EXPECT_THAT(access_.CheckPredictionAccess(nobody_, "q", Permission::kRead),
              StatusIs(Code::kNotFound));
  EXPECT_EQ(access_.CheckCaseAccess(nobody_, kCase, Permission::kRead)->owner, "");
}

TEST_F(AccessTest, UnownedResourcesAreOpenToAnonymousCallers) {
  SessionRecord session;
  session.id = "t";
  session.mesh_sha256 = std::string(64, 'a');
  Add(session);
  EXPECT_THAT(access_.CheckSessionAccess(nobody_, "t", Permission::kOwner), IsOk());
  EXPECT_THAT(access_.CheckSessionAccess(bob_, "t", Permission::kRead), StatusIs(Code::kNotFound));
  EXPECT_THAT(access_.CheckMeshAccess(nobody_, session.mesh_sha256, Permission::kOwner), IsOk());
  EXPECT_THAT(access_.CheckMeshAccess(bob_, session.mesh_sha256, Permission::kRead),
              StatusIs(Code::kNotFound));
}

TEST_F(AccessTest, AViewerLooksAndAPlannerDrags) {
  ASSERT_THAT(Share("sessions/s", "bob", ShareRole::kViewer), IsOk());
  EXPECT_THAT(access_.CheckSessionAccess(bob_, "s", Permission::kRead), IsOk());
  EXPECT_THAT(access_.CheckSessionAccess(bob_, "s", Permission::kWrite),
              StatusIs(Code::kPermissionDenied));
  EXPECT_THAT(access_.CheckPredictionAccess(bob_, "q", Permission::kRead), IsOk());
  EXPECT_THAT(access_.CheckPredictionAccess(bob_, "q", Permission::kOwner),
              StatusIs(Code::kPermissionDenied));
  EXPECT_THAT(access_.CheckMeshAccess(bob_, kMesh, Permission::kRead), IsOk());
  EXPECT_THAT(access_.CheckCaseAccess(bob_, kCase, Permission::kRead), StatusIs(Code::kNotFound));
  ASSERT_THAT(Share("sessions/s", "bob", ShareRole::kPlanner), IsOk());
  EXPECT_THAT(access_.CheckSessionAccess(bob_, "s", Permission::kWrite), IsOk());
  EXPECT_THAT(access_.CheckSessionAccess(bob_, "s", Permission::kOwner),
              StatusIs(Code::kPermissionDenied));
  EXPECT_THAT(*access_.SharedSessions(bob_), ElementsAre("s"));
  EXPECT_THAT(*access_.SharedPredictions(bob_), ElementsAre("q"));
  EXPECT_THAT(*access_.SharedSessions(ann_), IsEmpty()) << "they are her own";
}

TEST_F(AccessTest, ProjectShareCoversAllResourcesOfItsOwnerInIt) {
  ASSERT_THAT(Share("projects/p", "bob", ShareRole::kPlanner), IsOk());
  EXPECT_THAT(access_.CheckSessionAccess(bob_, "s", Permission::kWrite), IsOk());
  ASSERT_OK_AND_ASSIGN(const CaseKey found,
                       access_.CheckCaseAccess(bob_, kCase, Permission::kRead));
  EXPECT_EQ(found.owner, "ann");
  EXPECT_THAT(*access_.SharedCases(bob_), ElementsAre(CaseKey{kCase, "ann"}));
  SessionRecord others;
  others.id = "o";
  others.owner = "cid";
  others.project = "p";
  Add(others);
  EXPECT_THAT(access_.CheckSessionAccess(bob_, "o", Permission::kRead), StatusIs(Code::kNotFound))
      << "another's project of this name";
}

TEST_F(AccessTest, OwnCaseTakesPrecedenceOverASharedOne) {
  ASSERT_THAT(Share("cases/" + kCase, "bob"), IsOk());
  EXPECT_EQ(access_.CheckCaseAccess(bob_, kCase, Permission::kRead)->owner, "ann");
  EXPECT_THAT(access_.CheckCaseAccess(bob_, kCase, Permission::kOwner),
              StatusIs(Code::kPermissionDenied));
  AddCase("bob", "");
  EXPECT_EQ(access_.CheckCaseAccess(bob_, kCase, Permission::kOwner)->owner, "bob");
  EXPECT_THAT(*access_.SharedCases(bob_), IsEmpty()) << "one a name";
}

TEST_F(AccessTest, ReusedIdDoesNotRevealThePreviousOwnersPrediction) {
  ASSERT_THAT(DeleteSession(stores_->sessions(), "s"), IsOk());
  SessionRecord session;
  session.id = "s";
  session.owner = "bob";
  Add(session);
  EXPECT_THAT(access_.CheckSessionAccess(bob_, "s", Permission::kOwner), IsOk());
  EXPECT_THAT(access_.CheckPredictionAccess(bob_, "q", Permission::kRead),
              StatusIs(Code::kNotFound));
}

TEST_F(AccessTest, LinkReachesOnlyItsSessionAndCase) {
  const Principal link{.name = "link:s", .only_session = "sessions/s"};
  EXPECT_THAT(access_.CheckSessionAccess(link, "s", Permission::kRead),
              StatusIs(Code::kUnauthenticated))
      << "nobody has made one";
  ASSERT_THAT(
      changes_.AddLink(
          ann_, {.digest = "d", .session = "s", .case_sha256 = kCase, .expires_s = now_s_ + 1}),
      IsOk());
  EXPECT_THAT(access_.CheckSessionAccess(link, "s", Permission::kRead), IsOk());
  EXPECT_THAT(access_.CheckSessionAccess(link, "s", Permission::kWrite),
              StatusIs(Code::kPermissionDenied));
  EXPECT_THAT(access_.CheckSessionAccess(link, "t", Permission::kRead), StatusIs(Code::kNotFound));
  EXPECT_THAT(access_.CheckPredictionAccess(link, "q", Permission::kRead),
              StatusIs(Code::kNotFound));
  EXPECT_THAT(access_.CheckMeshAccess(link, kMesh, Permission::kRead), IsOk());
  EXPECT_EQ(access_.CheckCaseAccess(link, kCase, Permission::kRead)->owner, "ann");
  EXPECT_THAT(access_.CheckCaseAccess(link, kMesh, Permission::kRead), StatusIs(Code::kNotFound));
  now_s_ += 1;
  EXPECT_THAT(access_.CheckSessionAccess(link, "s", Permission::kRead),
              StatusIs(Code::kUnauthenticated));
  EXPECT_THAT(access_.FindLink("d").status(), StatusIs(Code::kUnauthenticated));
}

TEST_F(AccessTest, LinkEndsWhenItsCreatorMayNoLongerDrag) {
  ASSERT_THAT(Share("sessions/s", "bob", ShareRole::kPlanner), IsOk());
  ASSERT_THAT(changes_.AddLink(bob_, {.digest = "d", .session = "s", .expires_s = now_s_ + 100}),
              IsOk());
  EXPECT_THAT(access_.FindLink("d"), IsOk());
  ASSERT_THAT(Share("sessions/s", "bob", ShareRole::kViewer), IsOk());
  EXPECT_THAT(access_.FindLink("d").status(), StatusIs(Code::kUnauthenticated));
}

TEST_F(AccessTest, LinkMayCallFollowerMethodsAndPublisherMayUpload) {
  const Principal link{.name = "link:s", .only_session = "sessions/s"};
  EXPECT_THAT(Access::CheckMethodAccess(link, "DeformService.Watch"), IsOk());
  EXPECT_THAT(Access::CheckMethodAccess(link, "CaseService.ReadCase"), IsOk());
  EXPECT_THAT(Access::CheckMethodAccess(link, "DeformService.Deform"),
              StatusIs(Code::kPermissionDenied));
  EXPECT_THAT(Access::CheckMethodAccess(link, "MeshService.UploadMesh"),
              StatusIs(Code::kPermissionDenied));
  EXPECT_THAT(Access::CheckMethodAccess(ann_, "CaseService.UploadCase"),
              StatusIs(Code::kPermissionDenied));
  EXPECT_THAT(Access::CheckMethodAccess(nobody_, "CaseService.UploadCase"), IsOk());
  EXPECT_THAT(
      Access::CheckMethodAccess({.name = "ann", .roles = {"publisher"}}, "CaseService.UploadCase"),
      IsOk());
}

TEST_F(AccessTest, StoredDataCountsTowardsItsOwnersQuota) {
  access_.set_most_bytes(100);
  ASSERT_OK_AND_ASSIGN(const auto holdings, access_.HoldingsByOwner());
  const auto bytes = static_cast<int64_t>(kCaseBytes.size());
  EXPECT_EQ(holdings.at("ann").bytes, bytes);
  EXPECT_EQ(holdings.at("ann").sessions, 1);
  EXPECT_THAT(access_.CheckStorageQuota(ann_, 100 - bytes), IsOk());
  EXPECT_THAT(access_.CheckStorageQuota(ann_, 101 - bytes), StatusIs(Code::kResourceExhausted));
  EXPECT_THAT(access_.CheckStorageQuota(bob_, 100), IsOk());
  EXPECT_THAT(access_.CheckStorageQuota(nobody_, 1000), IsOk()) << "without logins";
}

TEST_F(AccessTest, OnlyAProjectOfTheTokenTakesNewResources) {
  EXPECT_THAT(Access::CheckProjectAccess(ann_, ""), IsOk());
  EXPECT_THAT(Access::CheckProjectAccess(ann_, "p"), StatusIs(Code::kPermissionDenied));
  EXPECT_THAT(Access::CheckProjectAccess({.name = "ann", .projects = {"p"}}, "p"), IsOk());
  EXPECT_THAT(Access::CheckProjectAccess(nobody_, "p"), IsOk());
  EXPECT_THAT(Access::CheckProjectAccess(nobody_, "p\n"), StatusIs(Code::kInvalidArgument));
  EXPECT_THAT(Access::CheckProjectAccess(nobody_, std::string(129, 'p')),
              StatusIs(Code::kInvalidArgument));
}

TEST_F(AccessTest, DatabaseOutageKeepsOnlyRecentlyCheckedAccess) {
  AwayDatabase database(&stores_->database());
  AccessQueries queries(&database);
  Access access(&queries);
  ASSERT_THAT(Share("sessions/s", "bob"), IsOk());
  ASSERT_THAT(access.CheckSessionAccess(bob_, "s", Permission::kRead), IsOk());
  ASSERT_THAT(access.CheckSessionAccess(Principal{.name = "cid"}, "s", Permission::kRead),
              StatusIs(Code::kNotFound));
  database.set_away(true);
  EXPECT_THAT(access.CheckSessionAccess(bob_, "s", Permission::kRead), IsOk());
  EXPECT_THAT(access.CheckSessionAccess(bob_, "s", Permission::kWrite),
              StatusIs(Code::kPermissionDenied));
  EXPECT_THAT(access.CheckSessionAccess(Principal{.name = "cid"}, "s", Permission::kRead),
              StatusIs(Code::kNotFound));
  EXPECT_THAT(access.CheckSessionAccess(ann_, "s", Permission::kRead), StatusIs(Code::kUnavailable))
      << "she was not there";
  EXPECT_THAT(access.RecheckSessionAccess(ann_, "s", Permission::kRead), IsOk())
      << "what uses the session ends with the reason";
  EXPECT_THAT(access.CheckPredictionAccess(ann_, "q", Permission::kRead),
              StatusIs(Code::kUnavailable));
}

TEST_F(AccessTest, ADatabaseThatIsAwayIsAskedForSessionsOnceASecond) {
  AwayDatabase database(&stores_->database());
  AccessQueries queries(&database);
  Access access(&queries);
  database.set_away(true);
  for (int i = 0; i < 100; ++i) {
    EXPECT_THAT(access.CheckSessionAccess(ann_, "s", Permission::kRead),
                StatusIs(Code::kUnavailable));
  }
  EXPECT_LT(database.asked(), 100);
  database.set_away(false);
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (!access.CheckSessionAccess(ann_, "s", Permission::kOwner).ok() &&
         std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  EXPECT_THAT(access.CheckSessionAccess(ann_, "s", Permission::kOwner), IsOk());
}

}  // namespace
}  // namespace tissueform::testing
