// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/session_leases.h"

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

#include "server/store/postgres_store/postgres_session_leases.h"
#include "server/store/sql_session_store.h"
#include "server/store/store_records.h"
#include "tests/server/store/postgres_store/lease_steps.h"
#include "tests/server/store/postgres_store/test_database.h"
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
        a_(stores->pool(), "A", {}, [this] { return Ask(); }),
        b_(stores->pool(), "B", {}, [this] { return Ask(); }) {
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
  void DelayNext(milliseconds duration) override { next_delay_ = duration; }
  std::chrono::steady_clock::time_point Now() const override { return now_; }

 private:
  // Leases ask for the time first; then they are done.
  std::chrono::steady_clock::time_point Ask() {
    const auto asked = now_;
    if (next_delay_.count() > 0) Wait(std::exchange(next_delay_, {}));
    return asked;
  }

  PostgresStores* const stores_;
  const std::string session_;
  std::chrono::steady_clock::time_point now_{std::chrono::hours(1)};
  milliseconds next_delay_{0};
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

TEST_F(PostgresLeasesTest, MatchesTheModelForEveryStepFromEveryState) {
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

TEST_F(PostgresLeasesTest, OneOfSeveralConcurrentTakeoversSucceeds) {
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

TEST_F(PostgresLeasesTest, FormerOwnerCannotWriteALostSession) {
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

TEST_F(PostgresLeasesTest, StalledCommitDoesNotBlockATakeover) {
  ASSERT_THAT(CreateSession(stores_->sessions(), SampleSession("s", 1), kFreshEpoch), IsOk());
  PostgresOptions options = TestDatabaseOptions();
  options.idle_timeout = milliseconds(50);
  ASSERT_OK_AND_ASSIGN(const auto pool, PostgresPool::Open(options));
  PostgresSessionLeases old_owner(pool.get(), "A");
  PostgresSessionLeases new_owner(stores_->pool(), "B");
  ASSERT_OK_AND_ASSIGN(const LeaseAnswer first, old_owner.Acquire("s"));
  ASSERT_THAT(CommitPoses(stores_->sessions(), "s", SamplePoses(1), first.lease.epoch), IsOk());
  LeaseAnswer second;
  const absl::Status late = pool->Run([&](PostgresTransaction& transaction) {
    absl::Status written =
        CommitPoseRow(transaction, "s", 0, Seal(SerializePoses({})), first.lease.epoch, 1);
    if (second.mine) return written;  // tried again
    EXPECT_THAT(written, IsOk());
    RunSql("UPDATE test_clock SET now = now + interval '10 seconds';");
    const absl::StatusOr<LeaseAnswer> answer = new_owner.Acquire("s");
    EXPECT_THAT(answer, IsOk());
    if (answer.ok()) second = *answer;
    return written;
  });
  EXPECT_TRUE(second.mine);
  EXPECT_FALSE(late.ok());
  ASSERT_OK_AND_ASSIGN(const SessionRecord kept, GetSession(stores_->sessions(), "s"));
  EXPECT_EQ(kept.epoch, second.lease.epoch);
  EXPECT_EQ(SerializePoses(kept.last_poses), SerializePoses(SamplePoses(1)));
}

TEST_F(PostgresLeasesTest, FormerOwnerCannotWriteANewSessionOfTheSameName) {
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

TEST_F(PostgresLeasesTest, LockedSessionDoesNotCostOtherLeases) {
  for (const char* session : {"s", "t"}) {
    ASSERT_THAT(CreateSession(stores_->sessions(), SampleSession(session, 1), kFreshEpoch), IsOk());
  }
  PostgresOptions options = TestDatabaseOptions();
  options.lock_timeout = milliseconds(50);
  ASSERT_OK_AND_ASSIGN(const auto pool, PostgresPool::Open(options));
  std::chrono::steady_clock::time_point now{std::chrono::hours(1)};
  PostgresSessionLeases leases(pool.get(), "A", {}, [&] { return now; });
  std::vector<std::string> lost;
  LeaseKeeper keeper(&leases, {.clock = [&] { return now; }},
                     [&](const SessionLease& lease) { lost.push_back(lease.session); });
  ASSERT_OK_AND_ASSIGN(const LeaseAnswer s, keeper.Acquire("s"));
  const auto pass = [&](int seconds) {
    now += std::chrono::seconds(seconds);
    RunSql(absl::StrCat("UPDATE test_clock SET now = now + ", seconds, " * interval '1 second';"));
  };
  const auto lock_s = [](PostgresTransaction& transaction) {
    return transaction.Run(
        "SELECT 1 FROM session_states WHERE key = (SELECT key FROM sessions WHERE id = 's') FOR "
        "UPDATE",
        {});
  };
  ASSERT_THAT(stores_->pool()->Run([&](PostgresTransaction& transaction) {
    EXPECT_THAT(lock_s(transaction), IsOk());
    EXPECT_THAT(keeper.Acquire("s"), StatusIs(absl::StatusCode::kUnavailable));
    EXPECT_THAT(keeper.Acquire("t"), IsOk()) << "the database answers";
    pass(6);
    EXPECT_THAT(keeper.Renew(), IsOk());
    pass(2);
    EXPECT_EQ(keeper.EpochOf("s"), s.lease.epoch) << "until its time is over";
    return absl::OkStatus();
  }),
              IsOk());
  ASSERT_THAT(keeper.Renew(), IsOk());
  pass(8);
  EXPECT_EQ(keeper.EpochOf("s"), s.lease.epoch);
  ASSERT_THAT(keeper.Renew(), IsOk());
  ASSERT_THAT(stores_->pool()->Run([&](PostgresTransaction& transaction) {
    EXPECT_THAT(lock_s(transaction), IsOk());
    pass(9);
    EXPECT_THAT(keeper.Renew(), IsOk());
    EXPECT_EQ(keeper.EpochOf("s"), std::nullopt);
    EXPECT_THAT(lost, ::testing::IsEmpty());
    pass(1);
    EXPECT_THAT(keeper.Renew(), IsOk());
    EXPECT_THAT(lost, ::testing::ElementsAre("s"));
    EXPECT_NE(keeper.EpochOf("t"), std::nullopt);
    return absl::OkStatus();
  }),
              IsOk());
}

TEST_F(PostgresLeasesTest, AnUnknownSessionIsNotFound) {
  PostgresSessionLeases leases(stores_->pool(), "A");
  EXPECT_THAT(leases.Acquire("nothing"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("nothing")));
  EXPECT_THAT(leases.Release("nothing", 1), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto renewed, leases.Renew());
  EXPECT_TRUE(renewed.empty());
}

TEST_F(PostgresLeasesTest, ClockSetBackKeepsRenewedLeasesAndExpiresDeadOnes) {
  for (const char* session : {"dead", "alive"}) {
    ASSERT_THAT(CreateSession(stores_->sessions(), SampleSession(session, 1), kFreshEpoch), IsOk());
  }
  std::chrono::steady_clock::time_point now{std::chrono::hours(1)};
  const auto clock = [&] { return now; };
  PostgresSessionLeases dead(stores_->pool(), "A", {}, clock);
  PostgresSessionLeases alive(stores_->pool(), "B", {}, clock);
  PostgresSessionLeases others(stores_->pool(), "C", {}, clock);
  ASSERT_OK_AND_ASSIGN(const LeaseAnswer before, dead.Acquire("dead"));
  ASSERT_THAT(alive.Acquire("alive"), IsOk());
  RunSql("UPDATE test_clock SET now = now - interval '1 hour';");
  const auto take = [&](const std::string& session) {
    const absl::StatusOr<LeaseAnswer> answer = others.Acquire(session);
    EXPECT_THAT(answer, IsOk());
    return answer.value_or(LeaseAnswer());
  };
  EXPECT_FALSE(take("dead").mine);
  EXPECT_FALSE(take("alive").mine);
  const auto pass = [&](milliseconds time) {
    now += time;
    RunSql(absl::StrCat("UPDATE test_clock SET now = now + ", time.count(),
                        " * interval '1 millisecond';"));
  };
  pass(milliseconds(3'000));
  ASSERT_THAT(alive.Renew(), IsOk());
  pass(milliseconds(6'999));
  EXPECT_FALSE(take("dead").mine) << "its holder may answer still";
  pass(milliseconds(1));
  EXPECT_FALSE(take("alive").mine);
  const LeaseAnswer taken = take("dead");
  EXPECT_TRUE(taken.mine);
  EXPECT_GT(taken.lease.epoch, before.lease.epoch);
  ASSERT_OK_AND_ASSIGN(const std::vector<SessionLease> left, dead.Renew());
  EXPECT_THAT(left, ::testing::IsEmpty());
}

TEST_F(PostgresLeasesTest, LeasesUseTheDatabaseClock) {
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
