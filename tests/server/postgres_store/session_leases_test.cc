// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/postgres_store/session_leases.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <deque>
#include <memory>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "server/postgres_store/postgres_session_leases.h"
#include "tests/server/postgres_store/lease_steps.h"
#include "tests/server/postgres_store/test_database.h"
#include "tests/server/store/store_samples.h"
#include "tests/server/store/waiting_calls.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;

// The clock of leases is a row that tests set.
class PostgresLeasesTest : public ::testing::Test {
 protected:
  void SetUp() override {
    TF_SKIP_WITHOUT_DATABASE();
    EmptyTestDatabase();
    stores_ = OpenTestStores();
    RunSql(
        "CREATE TABLE test_clock (now timestamptz NOT NULL); INSERT INTO test_clock VALUES "
        "('2026-01-01 00:00:00Z'); CREATE OR REPLACE FUNCTION tissueform_now() RETURNS timestamptz "
        "VOLATILE LANGUAGE sql AS 'SELECT now FROM test_clock';");
  }

  std::unique_ptr<PostgresStores> stores_;
};

// One session in the database, and two servers with holders of their own.
class PostgresLeaseWorld final : public LeaseWorld {
 public:
  PostgresLeaseWorld(PostgresStores* stores, int number)
      : stores_(stores),
        session_(absl::StrCat("s", number)),
        a_(stores->pool(), "A", {}, [this] { return now_; }),
        b_(stores->pool(), "B", {}, [this] { return now_; }) {
    first_epoch_ = MakeAgain();
  }

  SessionLeases* leases(int server) override { return server == 0 ? &a_ : &b_; }
  std::string session() const override { return session_; }
  bool Commit(int64_t epoch) override {
    return CommitPoses(stores_->sessions(), session_, SamplePoses(1), epoch).ok();
  }
  bool Delete(int64_t epoch) override {
    return DeleteSession(stores_->sessions(), session_, "", epoch).ok();
  }
  int64_t MakeAgain() override {
    const auto made = CreateSession(stores_->sessions(), SampleSession(session_, 1), kFreshEpoch);
    EXPECT_THAT(made, IsOk());
    return made.ok() ? made->epoch : 0;
  }
  int64_t FirstEpoch() const override { return first_epoch_; }
  void Wait(milliseconds duration) override {
    now_ += duration;
    EXPECT_THAT(stores_->pool()->Run([duration](PostgresTransaction& transaction) {
      return transaction.Run(
          "UPDATE test_clock SET now = now + $1::bigint * interval '1 millisecond'",
          {int64_t{duration.count()}});
    }),
                IsOk());
  }
  std::chrono::steady_clock::time_point Now() const override { return now_; }

 private:
  PostgresStores* const stores_;
  const std::string session_;
  std::chrono::steady_clock::time_point now_{std::chrono::hours(1)};
  int64_t first_epoch_ = 0;
  PostgresSessionLeases a_;
  PostgresSessionLeases b_;
};

// What the model shows of the steps, and in which state it is then.
std::pair<std::string, std::string> ModelAfter(const LeaseSteps& steps) {
  ModelLeaseWorld world;
  LeaseServers servers(&world);
  std::string seen;
  for (const LeaseStep& step : steps) absl::StrAppend(&seen, servers.Take(step), "\n");
  std::string row = "none";
  if (world.row() != nullptr) {
    const int64_t left = (world.row()->lease_until - world.Now()) / milliseconds(1);
    row = absl::StrCat(world.row()->holder, " ", std::max<int64_t>(left, 0));
  }
  return {seen, absl::StrCat(row, " ", servers.Knowledge(world.Now()))};
}

TEST_F(PostgresLeasesTest, FromEveryStateThatThereIsTheDatabaseTakesEveryStepAsTheModelDoes) {
  std::set<std::string> known = {ModelAfter({}).second};
  std::deque<LeaseSteps> open = {{}};
  int number = 0;
  while (!open.empty()) {
    const LeaseSteps before = std::move(open.front());
    open.pop_front();
    for (const LeaseStep& step : AllLeaseSteps()) {
      LeaseSteps steps = before;
      steps.push_back(step);
      const auto [expected, state] = ModelAfter(steps);
      PostgresLeaseWorld world(stores_.get(), ++number);
      LeaseServers servers(&world);
      std::string seen;
      for (const LeaseStep& taken : steps) absl::StrAppend(&seen, servers.Take(taken), "\n");
      ASSERT_EQ(seen, expected) << ToString(steps);
      if (known.insert(state).second) open.push_back(std::move(steps));
    }
  }
  EXPECT_GT(known.size(), 20U);
  RecordProperty("states", static_cast<int>(known.size()));
  RecordProperty("orders", number);
}

TEST_F(PostgresLeasesTest, OfServersThatTakeASessionOverAtOnceOneGetsIt) {
  ASSERT_OK_AND_ASSIGN(const SessionRecord made,
                       CreateSession(stores_->sessions(), SampleSession("s", 1), kFreshEpoch));
  int64_t newest = made.epoch;
  for (int round = 1; round <= 10; ++round) {
    std::vector<std::thread> threads;
    std::atomic<int> winners = 0;
    std::atomic<int64_t> epoch = 0;
    threads.reserve(6);
    for (int i = 0; i < 6; ++i) {
      threads.emplace_back([&] {
        PostgresSessionLeases leases(stores_->pool(), "same-name");
        const absl::StatusOr<LeaseAnswer> answer = leases.Acquire("s");
        EXPECT_THAT(answer, IsOk());
        if (answer.ok() && answer->mine) {
          ++winners;
          epoch = answer->lease.epoch;
        }
      });
    }
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(winners, 1);
    EXPECT_GT(epoch, newest);
    newest = epoch;
    RunSql("UPDATE test_clock SET now = now + interval '10 seconds';");
  }
}

TEST_F(PostgresLeasesTest, WhoHasLostASessionWritesNothingOfItAnyMore) {
  ASSERT_OK_AND_ASSIGN(SessionRecord record,
                       CreateSession(stores_->sessions(), SampleSession("s", 1)));
  PostgresSessionLeases old_owner(stores_->pool(), "A");
  PostgresSessionLeases new_owner(stores_->pool(), "B");
  ASSERT_OK_AND_ASSIGN(const LeaseAnswer first, old_owner.Acquire("s"));
  ASSERT_THAT(CommitPoses(stores_->sessions(), "s", SamplePoses(1), first.lease.epoch), IsOk());
  RunSql("UPDATE test_clock SET now = now + interval '10 seconds';");
  EXPECT_THAT(CommitPoses(stores_->sessions(), "s", SamplePoses(2), first.lease.epoch), IsOk())
      << "late, but nobody has taken it over";
  ASSERT_OK_AND_ASSIGN(const LeaseAnswer second, new_owner.Acquire("s"));
  ASSERT_TRUE(second.mine);
  const auto refused = StatusIs(absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(CommitPoses(stores_->sessions(), "s", SamplePoses(3), first.lease.epoch), refused);
  EXPECT_THAT(UpdateSession(stores_->sessions(), record, first.lease.epoch), refused);
  EXPECT_THAT(DeleteSession(stores_->sessions(), "s", "", first.lease.epoch), refused);
  EXPECT_THAT(UpdateSession(stores_->sessions(), record, second.lease.epoch), IsOk())
      << "a lease is no version of the record";
  ASSERT_OK_AND_ASSIGN(record, GetSession(stores_->sessions(), "s"));
  EXPECT_EQ(record.epoch, second.lease.epoch);
}

TEST_F(PostgresLeasesTest, WhoHeldASessionWritesNothingOfTheNextOneOfItsName) {
  ASSERT_THAT(CreateSession(stores_->sessions(), SampleSession("s", 1), kFreshEpoch), IsOk());
  PostgresSessionLeases old_owner(stores_->pool(), "A");
  ASSERT_OK_AND_ASSIGN(const LeaseAnswer before, old_owner.Acquire("s"));
  RunSql("DELETE FROM sessions");
  ASSERT_OK_AND_ASSIGN(SessionRecord next,
                       CreateSession(stores_->sessions(), SampleSession("s", 2), kFreshEpoch));
  EXPECT_GT(next.epoch, before.lease.epoch);
  const auto refused = StatusIs(absl::StatusCode::kFailedPrecondition);
  const auto check = [&] {
    const int64_t old = before.lease.epoch;
    EXPECT_THAT(CommitPoses(stores_->sessions(), "s", SamplePoses(3), old), refused);
    EXPECT_THAT(UpdateSession(stores_->sessions(), next, old), refused);
    EXPECT_THAT(DeleteSession(stores_->sessions(), "s", "", old), refused);
  };
  check();
  PostgresSessionLeases new_owner(stores_->pool(), "B");
  ASSERT_OK_AND_ASSIGN(const LeaseAnswer after, new_owner.Acquire("s"));
  check();
  ASSERT_THAT(old_owner.Release("s", before.lease.epoch), IsOk());
  ASSERT_OK_AND_ASSIGN(const LeaseAnswer still, new_owner.Acquire("s"));
  EXPECT_EQ(still.lease.epoch, after.lease.epoch);
}

TEST_F(PostgresLeasesTest, AnUnknownSessionIsNotFound) {
  PostgresSessionLeases leases(stores_->pool(), "A");
  EXPECT_THAT(leases.Acquire("nothing"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("nothing")));
  EXPECT_THAT(leases.Release("nothing", 1), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto renewed, leases.Renew());
  EXPECT_TRUE(renewed.empty());
}

TEST_F(PostgresLeasesTest, TheClockOfLeasesIsTheDatabases) {
  RunSql(
      "CREATE OR REPLACE FUNCTION tissueform_now() RETURNS timestamptz VOLATILE LANGUAGE sql AS "
      "'SELECT clock_timestamp()';");
  ASSERT_THAT(CreateSession(stores_->sessions(), SampleSession("s", 1)), IsOk());
  // A server whose clock is an hour off.
  PostgresSessionLeases leases(stores_->pool(), "A", {}, [] {
    return std::chrono::steady_clock::now() + std::chrono::hours(1);
  });
  PostgresSessionLeases others(stores_->pool(), "B");
  ASSERT_THAT(leases.Acquire("s"), IsOk());
  ASSERT_OK_AND_ASSIGN(const LeaseAnswer answer, others.Acquire("s"));
  EXPECT_FALSE(answer.mine);
  EXPECT_EQ(RunSql("SELECT (lease_until - clock_timestamp() BETWEEN interval '1 second' AND "
                   "interval '10 seconds')::int FROM session_states")
                .Integer(0, 0),
            1);
}

}  // namespace
}  // namespace tissueform::testing
