// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <atomic>
#include <future>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "server/store/session_store.h"
#include "tests/server/store/stores_case.h"
#include "tests/server/store/waiting_calls.h"
#include "tests/testing/status_matchers.h"

// What every session store must do. A new store adds itself to AllStores.
namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::StatusIs;

using Result = absl::StatusOr<SessionRecord>;

// Calls that wait for their answer.
class SessionStoreContractTest : public ::testing::TestWithParam<StoresCase> {
 protected:
  static SessionRecord Record(const std::string& id, const std::string& owner = "") {
    SessionRecord record;
    record.id = id;
    record.owner = owner;
    record.mesh_sha256 = std::string(64, 'f');
    record.stiffness = 1000.0;
    record.fixed = {0, 1};
    record.handles = {{"chin", {2, 3}}};
    return record;
  }

  Result Create(const SessionRecord& record, int64_t epoch = 1) {
    return CreateSession(*store_, record, epoch);
  }
  Result Get(const std::string& id) { return GetSession(*store_, id); }
  Result Update(const SessionRecord& record, int64_t epoch = 1) {
    return UpdateSession(*store_, record, epoch);
  }
  absl::Status Delete(const std::string& id, const std::string& etag = "", int64_t epoch = 1) {
    return DeleteSession(*store_, id, etag, epoch);
  }
  absl::StatusOr<SessionStore::Page> List(const SessionStore::ListRequest& request) {
    return ListSessions(*store_, request);
  }
  absl::Status CommitPoses(const std::string& id, const std::vector<HandlePose>& poses,
                           int64_t epoch = 1) {
    return tissueform::CommitPoses(*store_, id, poses, epoch);
  }
  absl::Status Touch(const std::vector<std::string>& ids, int64_t now_s) {
    return WaitFor<absl::Status>([&](auto done) { store_->Touch(ids, now_s, done); });
  }
  absl::StatusOr<SessionStore::Page> ListUnused(int64_t before_s, int limit = 100) {
    return WaitFor<absl::StatusOr<SessionStore::Page>>(
        [&](auto done) { store_->ListUnused(before_s, limit, done); });
  }
  static HandlePose Moved(double x_mm) {
    HandlePose pose;
    pose.translation_mm.x() = x_mm;
    return pose;
  }
  static std::vector<std::string> Ids(const SessionStore::Page& page) {
    std::vector<std::string> ids;
    for (const SessionRecord& record : page.records) ids.push_back(record.id);
    return ids;
  }

  // The store's clock.
  std::atomic<int64_t> now_s_ = 1000;
  const std::unique_ptr<Stores> stores_ = GetParam().make([this] { return now_s_.load(); });
  SessionStore* const store_ = &stores_->sessions();
};

TEST_P(SessionStoreContractTest, CreatedSessionIsFoundUnchanged) {
  SessionRecord record = Record("a", "planner");
  record.project = "study";
  record.stiffness = "youngs_modulus_pa";
  record.model = DeformationModel::kLinearElastic;
  record.gradient_field.max_iterations = 7;
  record.last_poses.resize(1);
  record.last_poses[0].translation_mm = {1, 2, 3};
  record.request_id = "once";
  record.request_fingerprint = "print";
  ASSERT_OK_AND_ASSIGN(const SessionRecord created, Create(record, 4));
  EXPECT_EQ(SerializeRecord(created), SerializeRecord(record));
  EXPECT_FALSE(created.etag.empty());
  EXPECT_EQ(created.epoch, 4);
  ASSERT_OK_AND_ASSIGN(const SessionRecord found, Get("a"));
  EXPECT_EQ(SerializeRecord(found), SerializeRecord(record));
  EXPECT_EQ(found.etag, created.etag);
  EXPECT_EQ(found.epoch, 4);
}

TEST_P(SessionStoreContractTest, MissingSessionIsNotFound) {
  EXPECT_THAT(Get("a"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("a")));
  EXPECT_THAT(Update(Record("a")), StatusIs(absl::StatusCode::kNotFound, HasSubstr("a")));
  EXPECT_THAT(Delete("a"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("a")));
}

TEST_P(SessionStoreContractTest, ARecordNeedsAnIdAndAnIdIsTakenOnce) {
  EXPECT_THAT(Create(Record("")), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("id")));
  ASSERT_THAT(Create(Record("a", "first")), IsOk());
  EXPECT_THAT(Create(Record("a", "second")),
              StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("a")));
  EXPECT_THAT(Create(Record("a", "second"), 9),
              StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("a")))
      << "a higher epoch does not take it";
  ASSERT_OK_AND_ASSIGN(const SessionRecord found, Get("a"));
  EXPECT_EQ(found.owner, "first");
}

TEST_P(SessionStoreContractTest, AnUpdateOfTheNewestVersionIsKept) {
  ASSERT_OK_AND_ASSIGN(SessionRecord record, Create(Record("a")));
  std::string etag = record.etag;
  for (int i = 1; i <= 3; ++i) {
    record.poisson_ratio = 0.1 * i;
    ASSERT_OK_AND_ASSIGN(record, Update(record));
    EXPECT_NE(record.etag, etag) << "a version of its own";
    etag = record.etag;
    ASSERT_OK_AND_ASSIGN(const SessionRecord found, Get("a"));
    EXPECT_EQ(found.poisson_ratio, 0.1 * i);
    EXPECT_EQ(found.etag, etag);
  }
}

TEST_P(SessionStoreContractTest, AnUpdateOfAnOldVersionIsAborted) {
  ASSERT_OK_AND_ASSIGN(const SessionRecord first, Create(Record("a")));
  SessionRecord mine = first;
  mine.project = "mine";
  ASSERT_THAT(Update(mine), IsOk());
  SessionRecord theirs = first;
  theirs.project = "theirs";
  EXPECT_THAT(Update(theirs), StatusIs(absl::StatusCode::kAborted, HasSubstr("changed")));
  theirs.etag.clear();
  EXPECT_THAT(Update(theirs), StatusIs(absl::StatusCode::kAborted, HasSubstr("changed")))
      << "an update without etag is no way around it";
  EXPECT_THAT(Delete("a", first.etag), StatusIs(absl::StatusCode::kAborted, HasSubstr("changed")));
  ASSERT_OK_AND_ASSIGN(const SessionRecord found, Get("a"));
  EXPECT_EQ(found.project, "mine");
}

TEST_P(SessionStoreContractTest, TheSameContentAgainIsAnotherVersion) {
  ASSERT_OK_AND_ASSIGN(const SessionRecord first, Create(Record("a")));
  ASSERT_OK_AND_ASSIGN(const SessionRecord second, Update(first));
  EXPECT_NE(first.etag, second.etag);
  EXPECT_THAT(Update(first), StatusIs(absl::StatusCode::kAborted, HasSubstr("changed")));
}

TEST_P(SessionStoreContractTest, RecreatedRecordDoesNotAcceptOldEtags) {
  ASSERT_OK_AND_ASSIGN(const SessionRecord before, Create(Record("a")));
  ASSERT_THAT(Delete("a"), IsOk());
  ASSERT_THAT(Create(Record("a")), IsOk());
  EXPECT_THAT(Update(before), StatusIs(absl::StatusCode::kAborted, HasSubstr("changed")));
}

TEST_P(SessionStoreContractTest, AnOlderEpochIsRefusedWhateverItsEtag) {
  ASSERT_OK_AND_ASSIGN(SessionRecord record, Create(Record("a"), 5));
  EXPECT_THAT(Update(record, 4), StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("5")));
  EXPECT_THAT(Delete("a", "", 4), StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("5")));
  ASSERT_OK_AND_ASSIGN(record, Update(record, 6));  // another node takes it over
  EXPECT_EQ(record.epoch, 6);
  EXPECT_THAT(Update(record, 5), StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("6")))
      << "the newest etag does not help";
  EXPECT_THAT(Update(record, 6), IsOk()) << "the owner goes on";
}

TEST_P(SessionStoreContractTest, DeletedSessionIsGone) {
  ASSERT_OK_AND_ASSIGN(const SessionRecord record, Create(Record("a")));
  ASSERT_THAT(Create(Record("b")), IsOk());
  EXPECT_THAT(Delete("a", record.etag), IsOk());
  EXPECT_FALSE(Get("a").ok());
  EXPECT_THAT(Delete("a"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("a")));
  EXPECT_THAT(Get("b"), IsOk());
}

TEST_P(SessionStoreContractTest, ListsByOwnerInOrderPageAfterPage) {
  for (const char* id : {"d", "b", "a", "e", "c"}) {
    ASSERT_THAT(Create(Record(id, "planner")), IsOk());
    ASSERT_THAT(Create(Record(absl::StrCat(id, "2"), "other")), IsOk());
  }
  ASSERT_THAT(Create(Record("anonymous")), IsOk());
  SessionStore::ListRequest request{.owner = "planner", .after = "", .limit = 2};
  ASSERT_OK_AND_ASSIGN(SessionStore::Page page, List(request));
  EXPECT_THAT(Ids(page), ElementsAre("a", "b"));
  EXPECT_EQ(page.records[0].mesh_sha256, std::string(64, 'f')) << "whole records";
  request.after = page.next;
  ASSERT_THAT(Delete("c"), IsOk());
  ASSERT_OK_AND_ASSIGN(page, List(request));
  EXPECT_THAT(Ids(page), ElementsAre("d", "e"));
  EXPECT_EQ(page.next, "") << "that was all";
  ASSERT_OK_AND_ASSIGN(page, List({.owner = ""}));
  EXPECT_THAT(Ids(page), ElementsAre("anonymous"));
  ASSERT_OK_AND_ASSIGN(page, List({.owner = "nobody", .after = ""}));
  EXPECT_THAT(Ids(page), IsEmpty());
  ASSERT_OK_AND_ASSIGN(page, List({}));
  EXPECT_THAT(Ids(page), ElementsAre("a", "a2", "anonymous", "b", "b2", "c2", "d", "d2", "e", "e2"))
      << "no owner: of all";
  EXPECT_THAT(List({.owner = "", .after = "", .limit = 0}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("limit")));
}

TEST_P(SessionStoreContractTest, CopiesAreIsolated) {
  SessionRecord record = Record("a");
  ASSERT_THAT(Create(record), IsOk());
  record.handles[0].vertices.clear();
  ASSERT_OK_AND_ASSIGN(SessionRecord found, Get("a"));
  EXPECT_THAT(found.handles[0].vertices, ElementsAre(2, 3));
  found.handles[0].name = "other";
  ASSERT_OK_AND_ASSIGN(found, Get("a"));
  EXPECT_EQ(found.handles[0].name, "chin");
}

TEST_P(SessionStoreContractTest, OfConcurrentWritersOfOneVersionExactlyOneWins) {
  constexpr int kWriters = 8;
  constexpr int kRounds = 20;
  ASSERT_OK_AND_ASSIGN(SessionRecord record, Create(Record("a")));
  for (int round = 0; round < kRounds; ++round) {
    std::vector<Result> results(kWriters, absl::UnknownError(""));
    std::vector<std::thread> writers;
    writers.reserve(kWriters);
    for (int i = 0; i < kWriters; ++i) {
      writers.emplace_back([this, &results, i, record] {
        SessionRecord mine = record;
        mine.project = absl::StrCat(i);
        results[i] = Update(mine);
      });
    }
    for (std::thread& writer : writers) writer.join();
    ASSERT_OK_AND_ASSIGN(record, Get("a"));
    int winners = 0;
    for (int i = 0; i < kWriters; ++i) {
      if (!results[i].ok()) {
        EXPECT_EQ(results[i].status().code(), absl::StatusCode::kAborted);
        continue;
      }
      ++winners;
      EXPECT_EQ(record.project, absl::StrCat(i));
      EXPECT_EQ(record.etag, results[i]->etag);
    }
    EXPECT_EQ(winners, 1);
  }
}

TEST_P(SessionStoreContractTest, OfConcurrentCreatorsOfOneIdExactlyOneWins) {
  constexpr int kWriters = 8;
  std::vector<Result> results(kWriters, absl::UnknownError(""));
  std::vector<std::thread> writers;
  writers.reserve(kWriters);
  for (int i = 0; i < kWriters; ++i) {
    writers.emplace_back([this, &results, i] { results[i] = Create(Record("a")); });
  }
  for (std::thread& writer : writers) writer.join();
  int winners = 0;
  for (const Result& result : results) {
    winners += result.ok() ? 1 : 0;
    if (!result.ok()) {
      EXPECT_EQ(result.status().code(), absl::StatusCode::kAlreadyExists);
    }
  }
  EXPECT_EQ(winners, 1);
}

TEST_P(SessionStoreContractTest, AnAnswerMayAskTheStoreAgain) {
  ASSERT_THAT(Create(Record("a")), IsOk());
  std::promise<Result> answer;
  store_->Get("a", [this, &answer](const Result& record) {
    store_->Update(*record, 1, [&answer](Result updated) { answer.set_value(std::move(updated)); });
  });
  EXPECT_THAT(answer.get_future().get(), IsOk()) << "no lock is held over it";
}

TEST_P(SessionStoreContractTest, ACommitReplacesThePosesAndLeavesTheEtag) {
  SessionRecord record = Record("a");
  record.handles.push_back({"maxilla", {4}});
  record.node_order = {4, 0, 3, 1, 2};
  ASSERT_OK_AND_ASSIGN(record, Create(record));
  now_s_ = 1007;
  ASSERT_THAT(CommitPoses("a", {Moved(1), Moved(2)}), IsOk());
  ASSERT_OK_AND_ASSIGN(SessionRecord found, Get("a"));
  ASSERT_EQ(found.last_poses.size(), 2);
  EXPECT_EQ(found.last_poses[1].translation_mm.x(), 2);
  EXPECT_EQ(found.etag, record.etag);
  EXPECT_EQ(found.last_used_s, 1007) << "a drag is a use";
  found.last_poses.clear();
  EXPECT_EQ(SerializeRecord(found), SerializeRecord(record)) << "nothing else has changed";
  ASSERT_THAT(CommitPoses("a", {}), IsOk());
  ASSERT_OK_AND_ASSIGN(found, Get("a"));
  EXPECT_THAT(found.last_poses, IsEmpty()) << "at rest again";
  found.project = "study";
  EXPECT_THAT(Update(found), IsOk()) << "the etag is still good";
}

TEST_P(SessionStoreContractTest, AnUpdateReplacesThePosesToo) {
  ASSERT_OK_AND_ASSIGN(SessionRecord record, Create(Record("a")));
  ASSERT_THAT(CommitPoses("a", {Moved(1)}), IsOk());
  record.last_poses = {Moved(5)};
  ASSERT_THAT(Update(record), IsOk());
  ASSERT_OK_AND_ASSIGN(record, Get("a"));
  ASSERT_EQ(record.last_poses.size(), 1);
  EXPECT_EQ(record.last_poses[0].translation_mm.x(), 5);
}

TEST_P(SessionStoreContractTest, ACommitThatDoesNotFitIsRefused) {
  ASSERT_THAT(Create(Record("a"), 5), IsOk());
  ASSERT_THAT(CommitPoses("a", {Moved(1)}, 5), IsOk());
  EXPECT_THAT(CommitPoses("b", {}, 5), StatusIs(absl::StatusCode::kNotFound, HasSubstr("b")));
  EXPECT_THAT(CommitPoses("a", {Moved(2), Moved(3)}, 4),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("5")));
  EXPECT_THAT(CommitPoses("a", {Moved(2), Moved(3)}, 5),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("1 handles, not 2")));
  ASSERT_OK_AND_ASSIGN(SessionRecord found, Get("a"));
  ASSERT_EQ(found.last_poses.size(), 1);
  EXPECT_EQ(found.last_poses[0].translation_mm.x(), 1) << "nothing of it was kept";
  ASSERT_THAT(CommitPoses("a", {Moved(2)}, 6), IsOk());
  EXPECT_THAT(Update(found, 5), StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("6")))
      << "a commit is a write under its epoch";
}

TEST_P(SessionStoreContractTest, StoreSetsTimesThatNeverGoBack) {
  SessionRecord record = Record("a");
  record.created_s = 1;
  record.last_used_s = 5000;
  ASSERT_OK_AND_ASSIGN(record, Create(record));
  EXPECT_EQ(record.created_s, 1000);
  EXPECT_EQ(record.last_used_s, 1000);
  now_s_ = 900;  // the clock was set back
  record.created_s = 7;
  ASSERT_OK_AND_ASSIGN(record, Update(record));
  EXPECT_EQ(record.created_s, 1000);
  EXPECT_EQ(record.last_used_s, 1000);
  ASSERT_THAT(Touch({"b", "a"}, 1200), IsOk());
  ASSERT_THAT(Touch({"a"}, 1100), IsOk());
  ASSERT_OK_AND_ASSIGN(record, Get("a"));
  EXPECT_EQ(record.last_used_s, 1200);
  EXPECT_EQ(record.created_s, 1000);
}

TEST_P(SessionStoreContractTest, ListsLongUnusedSessionsOldestFirst) {
  for (const char* id : {"a", "b", "c", "d"}) {
    ASSERT_THAT(Create(Record(id, id)), IsOk());
  }
  ASSERT_THAT(Touch({"a"}, 1300), IsOk());
  ASSERT_THAT(Touch({"b"}, 1100), IsOk());
  ASSERT_THAT(Touch({"c"}, 1200), IsOk());
  ASSERT_OK_AND_ASSIGN(SessionStore::Page page, ListUnused(1300));
  EXPECT_THAT(Ids(page), ElementsAre("d", "b", "c"));
  ASSERT_OK_AND_ASSIGN(page, ListUnused(1300, 2));
  EXPECT_THAT(Ids(page), ElementsAre("d", "b"));
  ASSERT_OK_AND_ASSIGN(page, ListUnused(1000));
  EXPECT_THAT(Ids(page), IsEmpty());
  EXPECT_THAT(ListUnused(1000, 0),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("limit")));
}

INSTANTIATE_TEST_SUITE_P(Stores, SessionStoreContractTest, ::testing::ValuesIn(AllStores()),
                         [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace tissueform
