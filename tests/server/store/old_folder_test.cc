// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "server/exports/export_store.h"
#include "server/platform/storage/data_folder.h"
#include "server/platform/storage/database.h"
#include "server/store/access_queries.h"
#include "server/store/access_rows.h"
#include "server/store/durable_store.h"
#include "server/store/store_records.h"
#include "tests/server/store/store_samples.h"
#include "tests/server/store/store_workload.h"
#include "tests/server/store/stores_case.h"
#include "tests/server/store/waiting_calls.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

// Folders as servers before this one left them (tests/data/store/SOURCE.md).
namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::StatusIs;

class OldFolderTest : public ::testing::Test {
 protected:
  // A copy of the folder, in which a server of that version has done the first steps.
  void Copy(int version, int steps) {
    std::filesystem::copy(testing::SourcePath(absl::StrCat("tests/data/store/version", version)),
                          path_, std::filesystem::copy_options::recursive);
    std::filesystem::permissions(path_, std::filesystem::perms::owner_all);
    for (int number = 0; number < steps; ++number) Apply(number);
    model_.uploads.clear();  // not copied
  }
  void Apply(int number) { ApplyStep(number, /*bursts=*/true, &model_); }
  void OpenAndCheck() {
    store_.reset();
    ASSERT_OK_AND_ASSIGN(DataFolder folder, DataFolder::Open(path_));
    ASSERT_OK_AND_ASSIGN(store_, DurableStore::Open(std::move(folder)));
    EXPECT_THAT(store_->damaged(), IsEmpty());
    EXPECT_THAT(CheckAgainst(model_, model_, *store_), IsOk());
  }

  const ScratchFolder scratch_;
  const std::string path_ = scratch_ / "data";
  StoreModel model_;
  std::unique_ptr<DurableStore> store_;
};

TEST_F(OldFolderTest, FolderWithoutCasesKeepsItsDataAndAcceptsCases) {
  constexpr int kSteps = 16;
  Copy(2, kSteps);
  ASSERT_FALSE(model_.predictions.empty());
  ASSERT_NO_FATAL_FAILURE(OpenAndCheck());
  ASSERT_OK_AND_ASSIGN(const PredictionStore::Page of_no_case,
                       store_->predictions().List({.case_sha256 = ""}));
  EXPECT_THAT(of_no_case.records, SizeIs(model_.predictions.size()));
  for (int number = kSteps; number < kStepsOfARound; ++number) {
    ASSERT_THAT(RunStep(number, /*bursts=*/true, *store_), IsOk());
    Apply(number);
  }
  EXPECT_THAT(model_.cases, SizeIs(1));
  OpenAndCheck();
}

TEST_F(OldFolderTest, FolderWithoutRightsKeepsItsDataAndAcceptsCasesPerOwner) {
  Copy(3, 17);
  ASSERT_THAT(model_.cases, SizeIs(1));
  ASSERT_NO_FATAL_FAILURE(OpenAndCheck());
  const std::string bytes = SampleCase(*model_.cases.begin());
  CaseRecord others = CaseRecordOf(bytes);
  others.owner = "another";
  ASSERT_THAT(KeepCase(store_->cases(), others, bytes), IsOk());
  ASSERT_NO_FATAL_FAILURE(OpenAndCheck());
  EXPECT_THAT(store_->cases().Find(others.key()), IsOk());
}

TEST_F(OldFolderTest, FolderWithoutExportsKeepsItsDataAndAcceptsExports) {
  Copy(4, 17);
  ASSERT_FALSE(model_.predictions.empty());
  ASSERT_NO_FATAL_FAILURE(OpenAndCheck());
  ASSERT_THAT(SqlExportStore(&store_->database()).Put({.id = "a", .prediction = "p"}), IsOk());
  OpenAndCheck();
}

TEST_F(OldFolderTest, FolderWithoutMeshNamesOfSessionsLearnsThem) {
  Copy(5, 17);
  ASSERT_NO_FATAL_FAILURE(OpenAndCheck());
  ASSERT_OK_AND_ASSIGN(const MeshStore::Page meshes, store_->meshes().List("", 100));
  ASSERT_OK_AND_ASSIGN(const SessionStore::Page sessions,
                       ListSessions(store_->sessions(), {.limit = 100}));
  std::map<std::string, int> made_from;
  for (const SessionRecord& record : sessions.records) ++made_from[record.mesh_sha256];
  for (const MeshRecord& mesh : meshes.records) {
    const absl::Status deleted = store_->meshes().Delete(mesh.sha256);
    EXPECT_EQ(deleted.ok(), made_from[mesh.sha256] == 0) << deleted;
  }
}

TEST_F(OldFolderTest, ExportWithoutAVersionColumnIsChangedOnlyOnce) {
  Copy(5, 17);
  ExportRecord record = {.id = "a", .prediction = "p", .version = 4};
  {
    ASSERT_OK_AND_ASSIGN(const auto database, Database::Open(path_ + "/tissueform.db"));
    const std::string bytes = Seal(SerializeExport(record));
    ASSERT_THAT(database->Prepare("INSERT INTO exports (name, record) VALUES ('a', ?)")
                    .BindBytes(bytes)
                    .Run(),
                IsOk());
  }
  ASSERT_NO_FATAL_FAILURE(OpenAndCheck());
  SqlExportStore exports(&store_->database());
  ASSERT_OK_AND_ASSIGN(const auto kept, exports.Load());
  EXPECT_THAT(kept, ElementsAre(record));
  record.version = 5;
  record.detail = "here";
  ASSERT_THAT(exports.Put(record), IsOk());
  record.detail = "there";
  EXPECT_THAT(exports.Put(record), StatusIs(absl::StatusCode::kAborted));
}

TEST_F(OldFolderTest, RowsFromBeforeThereWereIndexColumnsAreFoundByThem) {
  Copy(5, 17);
  const std::string session = model_.sessions.begin()->first;
  const ShareRow share = {.resource = absl::StrCat("sessions/", session),
                          .owner = "planner",
                          .principal = "bob",
                          .role = ShareRole::kPlanner};
  const FollowLinkRow link = {.digest = "d", .session = session, .maker = "bob", .expires_s = 9};
  const MeshRight right = {.principal = "bob", .sha256 = "m", .bytes = 7};
  {
    ASSERT_OK_AND_ASSIGN(const auto database, Database::Open(path_ + "/tissueform.db"));
    const auto insert = [&](const char* sql, const std::string& key, const std::string& row) {
      const std::string sealed = Seal(row);
      ASSERT_THAT(database->Prepare(sql).Bind(key).BindBytes(sealed).Run(), IsOk());
    };
    insert("INSERT INTO shares (name, record) VALUES (?, ?)", KeyOf(share), SerializeRow(share));
    insert("INSERT INTO follow_links (name, record) VALUES (?, ?)", KeyOf(link),
           SerializeRow(link));
    insert("INSERT INTO mesh_rights (name, record) VALUES (?, ?)", KeyOf(right),
           SerializeRow(right));
  }
  ASSERT_NO_FATAL_FAILURE(OpenAndCheck());
  AccessQueries queries(&store_->database());
  ASSERT_OK_AND_ASSIGN(const std::optional<LinkGrant> found, queries.FindLink("d"));
  ASSERT_TRUE(found.has_value() && found->maker.has_value());
  EXPECT_EQ(found->link, link);
  EXPECT_EQ(found->maker->role, ShareRole::kPlanner);
  ASSERT_OK_AND_ASSIGN(const SessionRecord record, GetSession(store_->sessions(), session));
  EXPECT_EQ(found->maker->mesh_sha256, record.mesh_sha256);
  EXPECT_EQ(queries.HoldingsOf("bob")->bytes, 7);
  ASSERT_OK_AND_ASSIGN(const PredictionStore::Page page, store_->predictions().List({}));
  ASSERT_FALSE(page.records.empty());
  for (const PredictionRecord& prediction : page.records) {
    EXPECT_TRUE(queries.PredictionsOfMesh(prediction.mesh_sha256)->contains(prediction.id));
  }
}

}  // namespace
}  // namespace tissueform
