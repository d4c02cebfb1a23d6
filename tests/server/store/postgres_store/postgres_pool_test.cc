// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/postgres_pool.h"

#include <chrono>
#include <functional>
#include <future>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "server/store/postgres_store/postgres_session_leases.h"
#include "server/store/store_errors.h"
#include "tests/server/store/postgres_store/frozen_proxy.h"
#include "tests/server/store/postgres_store/test_database.h"
#include "tests/server/store/store_samples.h"
#include "tests/server/store/waiting_calls.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using Code = absl::StatusCode;

class PostgresPoolTest : public ::testing::Test {
 protected:
  void SetUp() override {
    TF_SKIP_WITHOUT_DATABASE();
    EmptyTestDatabase();
    stores_ = OpenTestStores();
  }

  // Without TLS: the proxy reads what it forwards.
  static PostgresOptions Through(const FrozenProxy& proxy) {
    PostgresOptions options = TestDatabaseOptions();
    options.url =
        absl::StrCat("postgresql://postgres@127.0.0.1:", proxy.port(), "/postgres?sslmode=disable");
    return options;
  }

  std::unique_ptr<PostgresStores> stores_;
};

TEST_F(PostgresPoolTest, ReplacesAStalledConnectionAndContinuesTheCall) {
  FrozenProxy proxy(TestDatabasePort());
  PostgresOptions options = Through(proxy);
  options.unanswered_timeout = std::chrono::milliseconds(300);
  const auto stores = OpenTestStores(SystemUnixSeconds, options);
  ASSERT_THAT(CreateSession(stores->sessions(), SampleSession("s", 1)), IsOk());
  const int before = proxy.accepted();
  proxy.Freeze();
  EXPECT_THAT(CommitPoses(stores->sessions(), "s", SamplePoses(7)), IsOk());
  EXPECT_GT(proxy.accepted(), before);
  ASSERT_OK_AND_ASSIGN(const SessionRecord found, GetSession(stores_->sessions(), "s"));
  EXPECT_EQ(SerializePoses(found.last_poses), SerializePoses(SamplePoses(7)));
}

TEST_F(PostgresPoolTest, CallWaitsForOnlyOneOfSeveralFrozenConnections) {
  FrozenProxy proxy(TestDatabasePort());
  PostgresOptions options = Through(proxy);
  options.unanswered_timeout = std::chrono::milliseconds(1'500);
  options.patience = std::chrono::milliseconds(2'800);
  ASSERT_OK_AND_ASSIGN(const auto pool, PostgresPool::Open(options));
  const auto select = [](PostgresTransaction& transaction) {
    return transaction.Run("SELECT 1", {});
  };
  // Three at once, so that there are as many connections.
  ASSERT_THAT(pool->Run([&](PostgresTransaction&) {
    return pool->Run([&](PostgresTransaction&) { return pool->Run(select); });
  }),
              IsOk());
  const int before = proxy.accepted();
  proxy.Freeze();
  EXPECT_THAT(pool->Run(select), IsOk());
  EXPECT_EQ(proxy.accepted(), before + 1);
}

TEST_F(PostgresPoolTest, EndingWaitsReleasesAllWaiters) {
  FrozenProxy proxy(TestDatabasePort());
  PostgresOptions options = Through(proxy);
  options.patience = std::chrono::minutes(10);
  options.unanswered_timeout = std::chrono::minutes(10);
  options.max_connections = 2;
  ASSERT_OK_AND_ASSIGN(const auto pool, PostgresPool::Open(options));
  // One that waits for an answer, one that tries again, one that finds no connection free.
  std::promise<void> begun;
  const auto run = [&pool](const std::function<void()>& first, const char* sql) {
    return std::async(std::launch::async, [&pool, first, sql] {
      return pool->Run([&](PostgresTransaction& transaction) {
        first();
        return transaction.Execute(sql);
      });
    });
  };
  auto silent = run(
      [&] {
        proxy.FreezeAll();
        begun.set_value();
      },
      "SELECT 1");
  begun.get_future().wait();
  auto connecting = run([] {}, "SELECT 1");
  auto waiting = run([] {}, "SELECT 1");
  pool->EndWaiting(PostgresPool::Clock::now());
  for (auto* call : {&silent, &connecting, &waiting}) {
    ASSERT_EQ(call->wait_for(std::chrono::seconds(60)), std::future_status::ready);
    EXPECT_THAT(call->get(), StatusIs(Code::kUnavailable));
  }
  EXPECT_THAT(pool->Run([](PostgresTransaction&) { return absl::OkStatus(); }),
              StatusIs(Code::kUnavailable));
  proxy.Thaw();
}

TEST_F(PostgresPoolTest, EarlierWaitsCountTowardsPatienceWhileTheDatabaseIsAway) {
  RunOutsideTransaction("DROP DATABASE IF EXISTS away WITH (FORCE)");
  RunOutsideTransaction("CREATE DATABASE away");
  PostgresOptions options = TestDatabaseOptions("away");
  options.patience = std::chrono::minutes(10);
  options.waited = [] { return std::chrono::hours(1); };
  ASSERT_OK_AND_ASSIGN(const auto pool, PostgresPool::Open(options));
  const auto select = [](PostgresTransaction& transaction) {
    return transaction.Run("SELECT 1", {});
  };
  EXPECT_THAT(pool->Run(select), IsOk()) << "it was a queue that was slow";
  RunOutsideTransaction("ALTER DATABASE away ALLOW_CONNECTIONS false");
  RunSql("SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity WHERE datname = 'away'");
  EXPECT_THAT(pool->Run(select, PostgresPool::Clock::now() + std::chrono::milliseconds(100)),
              StatusIs(Code::kUnavailable));
  EXPECT_THAT(pool->Run(select), StatusIs(Code::kUnavailable, HasSubstr("in time")));
  RunOutsideTransaction("ALTER DATABASE away ALLOW_CONNECTIONS true");
  EXPECT_THAT(pool->Run(select, PostgresPool::Clock::now() + options.patience), IsOk());
  EXPECT_THAT(pool->Run(select), IsOk());
}

TEST_F(PostgresPoolTest, UnansweredCommitIsReportedAsPossiblySuccessful) {
  FrozenProxy proxy(TestDatabasePort());
  PostgresOptions options = Through(proxy);
  options.unanswered_timeout = std::chrono::milliseconds(300);
  ASSERT_OK_AND_ASSIGN(const auto pool, PostgresPool::Open(options));
  int calls = 0;
  EXPECT_THAT(pool->Run([&](PostgresTransaction& transaction) {
    ++calls;
    const absl::Status status =
        transaction.Execute("INSERT INTO blobs (sha256, bytes) VALUES ('x', 1)");
    proxy.Freeze();
    return status;
  }),
              StatusIs(Code::kUnavailable, HasSubstr("may have succeeded")));
  EXPECT_EQ(calls, 1) << "it is not tried again";
}

TEST_F(PostgresPoolTest, GetWaitsForCommitsAndPeekDoesNot) {
  FrozenProxy proxy(TestDatabasePort());
  PostgresOptions options = Through(proxy);
  options.unanswered_timeout = std::chrono::milliseconds(300);
  options.max_connections = 2;  // one thread for commits, one for who asks
  const auto stores = OpenTestStores(SystemUnixSeconds, options);
  ASSERT_THAT(CreateSession(stores->sessions(), SampleSession("s", 1)), IsOk());
  proxy.FreezeAll();
  std::promise<absl::Status> committed;
  std::future<absl::Status> answer = committed.get_future();
  stores->sessions().CommitPoses("s", SamplePoses(7), 1,
                                 [&](const absl::Status& status) { committed.set_value(status); });
  std::promise<absl::StatusOr<SessionRecord>> got;
  stores->sessions().Get("s", [&](auto record) { got.set_value(std::move(record)); });
  std::promise<absl::Status> peeked;
  stores->sessions().Peek("s", [&](const auto& record) { peeked.set_value(record.status()); });
  EXPECT_THAT(peeked.get_future().get(), StatusIs(Code::kUnavailable));
  EXPECT_EQ(answer.wait_for(std::chrono::seconds(0)), std::future_status::timeout);
  proxy.Thaw();
  EXPECT_THAT(answer.get(), IsOk());
  ASSERT_OK_AND_ASSIGN(const SessionRecord found, got.get_future().get());
  EXPECT_EQ(SerializePoses(found.last_poses), SerializePoses(SamplePoses(7)));
}

TEST_F(PostgresPoolTest, RetriesIdempotentWorkWhenItsCommitIsNotAnswered) {
  FrozenProxy proxy(TestDatabasePort());
  PostgresOptions options = Through(proxy);
  options.unanswered_timeout = std::chrono::milliseconds(300);
  options.idle_timeout = std::chrono::milliseconds(200);  // until what has locked is free
  const auto stores = OpenTestStores(SystemUnixSeconds, options);
  ASSERT_OK_AND_ASSIGN(const SessionRecord made,
                       CreateSession(stores->sessions(), SampleSession("s", 1), kFreshEpoch));
  PostgresSessionLeases leases(stores->pool(), "a", {.patience = options.patience});
  int connections = proxy.accepted();
  const auto lose_next_commit = [&] {
    proxy.FreezeAt("COMMIT");
    ++connections;
  };
  lose_next_commit();
  EXPECT_THAT(CommitPoses(stores->sessions(), "s", SamplePoses(7), made.epoch), IsOk());
  ASSERT_OK_AND_ASSIGN(const SessionRecord found, GetSession(stores->sessions(), "s"));
  EXPECT_EQ(SerializePoses(found.last_poses), SerializePoses(SamplePoses(7)));
  lose_next_commit();
  ASSERT_OK_AND_ASSIGN(const LeaseAnswer taken, leases.Acquire("s"));
  EXPECT_TRUE(taken.mine);
  lose_next_commit();
  ASSERT_OK_AND_ASSIGN(const std::vector<SessionLease> renewed, leases.Renew());
  ASSERT_EQ(renewed.size(), 1U);
  EXPECT_EQ(renewed[0].epoch, taken.lease.epoch);
  lose_next_commit();
  EXPECT_THAT(leases.Release("s", taken.lease.epoch), IsOk());
  EXPECT_GE(proxy.accepted(), connections) << "each was lost once";
  EXPECT_EQ(
      RunSql("SELECT count(*) FROM session_states WHERE lease_until = '-infinity'").Integer(0, 0),
      1);
}

TEST_F(PostgresPoolTest, FrozenConnectionWithoutPendingWorkFreesItsPlace) {
  FrozenProxy proxy(TestDatabasePort());
  PostgresOptions options = Through(proxy);
  options.unanswered_timeout = std::chrono::milliseconds(300);
  options.max_connections = 1;
  ASSERT_OK_AND_ASSIGN(const auto pool, PostgresPool::Open(options));
  EXPECT_THAT(pool->Run([&](PostgresTransaction& transaction) {
    EXPECT_THAT(transaction.Run("SELECT 1", {}), IsOk());
    proxy.Freeze();
    return absl::NotFoundError("nothing");
  }),
              StatusIs(Code::kNotFound));
  EXPECT_THAT(
      pool->Run([](PostgresTransaction& transaction) { return transaction.Run("SELECT 1", {}); }),
      IsOk());
}

TEST_F(PostgresPoolTest, OpenFailsIfTheDatabaseAcceptsButNeverAnswers) {
  FrozenProxy proxy(TestDatabasePort());
  proxy.FreezeWhenReady();
  PostgresOptions options = Through(proxy);
  options.unanswered_timeout = std::chrono::milliseconds(300);
  EXPECT_THAT(PostgresPool::Open(options).status(), StatusIs(Code::kUnavailable));
}

TEST_F(PostgresPoolTest, ReportsThatAllConnectionsAreInUseWhenTheTimeIsOver) {
  PostgresOptions options = TestDatabaseOptions();
  options.max_connections = 1;
  options.patience = std::chrono::milliseconds(200);
  ASSERT_OK_AND_ASSIGN(const auto pool, PostgresPool::Open(options));
  std::promise<void> begun;
  std::promise<void> released;
  std::thread holder([&] {
    EXPECT_THAT(pool->Run([&](PostgresTransaction&) {
      begun.set_value();
      released.get_future().wait();
      return absl::OkStatus();
    }),
                IsOk());
  });
  begun.get_future().wait();
  EXPECT_THAT(pool->Run([](PostgresTransaction&) { return absl::OkStatus(); }),
              StatusIs(Code::kUnavailable, HasSubstr("all 1 connections")));
  released.set_value();
  holder.join();
  EXPECT_THAT(pool->Run([](PostgresTransaction&) { return absl::OkStatus(); }), IsOk());
}

TEST_F(PostgresPoolTest, DoesNotBeginWorkAfterItsDeadline) {
  bool called = false;
  EXPECT_THAT(stores_->pool()->Run(
                  [&](PostgresTransaction&) {
                    called = true;
                    return absl::OkStatus();
                  },
                  PostgresPool::Clock::now() - std::chrono::milliseconds(1)),
              StatusIs(Code::kUnavailable, HasSubstr("in time")));
  EXPECT_FALSE(called);
}

TEST_F(PostgresPoolTest, EndsStatementsThatAreLockedOrTakeTooLong) {
  PostgresOptions options = TestDatabaseOptions();
  options.lock_timeout = std::chrono::milliseconds(50);
  options.statement_timeout = std::chrono::milliseconds(100);
  ASSERT_OK_AND_ASSIGN(const auto pool, PostgresPool::Open(options));
  EXPECT_THAT(pool->Run([](PostgresTransaction& transaction) {
    return transaction.Execute("SELECT pg_sleep(30)");
  }),
              StatusIs(Code::kUnavailable, HasSubstr("took too long")));
  ASSERT_THAT(stores_->pool()->Run([&](PostgresTransaction& transaction) {
    EXPECT_THAT(transaction.Execute("LOCK TABLE sessions"), IsOk());
    EXPECT_THAT(pool->Run([](PostgresTransaction& other) {
      return other.Run("SELECT count(*) FROM sessions", {});
    }),
                StatusIs(Code::kUnavailable, HasSubstr("locked for too long")));
    return absl::OkStatus();
  }),
              IsOk());
}

TEST_F(PostgresPoolTest, FailedWorkIsRolledBack) {
  EXPECT_THAT(stores_->pool()->Run([](PostgresTransaction& transaction) {
    EXPECT_THAT(transaction.Execute("INSERT INTO blobs (sha256, bytes) VALUES ('x', 1)"), IsOk());
    return absl::CancelledError("no");
  }),
              StatusIs(Code::kCancelled));
  EXPECT_EQ(RunSql("SELECT count(*) FROM blobs WHERE sha256 = 'x'").Integer(0, 0), 0);
  EXPECT_THAT(stores_->pool()->Run([](PostgresTransaction& transaction) {
    return transaction.Run("SELECT nothing", {});
  }),
              StatusIs(Code::kInternal, HasSubstr("SQLSTATE 42703")));
}

struct DatabaseError {
  const char* name;
  const char* sqlstate;
  Code code;
  const char* message;
  int calls;  // of the work: more where another try may do better
};

class PostgresErrorTest : public PostgresPoolTest,
                          public ::testing::WithParamInterface<DatabaseError> {};

TEST_P(PostgresErrorTest, ErrorsAreOneLineWithTheirCodeAndWithoutValues) {
  const DatabaseError& error = GetParam();
  int calls = 0;
  const absl::Status status = stores_->pool()->Run([&](PostgresTransaction& transaction) {
    if (++calls == 2) return absl::OkStatus();
    return transaction.Execute(absl::StrCat("DO $$ BEGIN RAISE EXCEPTION 'no' USING ERRCODE = '",
                                            error.sqlstate, "', DETAIL = 'hush'; END $$"));
  });
  EXPECT_EQ(calls, error.calls);
  EXPECT_EQ(status.code(), error.code) << status;
  EXPECT_THAT(std::string(status.message()),
              AllOf(HasSubstr(error.message), Not(HasSubstr("hush")), Not(HasSubstr("\n"))));
  if (!status.ok()) {
    EXPECT_THAT(MessageForClients(status),
                AllOf(Not(IsEmpty()), Not(HasSubstr("postgresql")), Not(HasSubstr("SQLSTATE")),
                      Not(HasSubstr("host"))));
  }
  EXPECT_THAT(CreateSession(stores_->sessions(), SampleSession("s", 1)), IsOk()) << "calls go on";
}

INSTANTIATE_TEST_SUITE_P(
    Errors, PostgresErrorTest,
    ::testing::Values(DatabaseError{"DiskFull", "53100", Code::kResourceExhausted,
                                    "free some space", 1},
                      DatabaseError{"ReadOnly", "25006", Code::kOk, "", 2},
                      DatabaseError{"NoText", "22021", Code::kInvalidArgument, "UTF-8", 1},
                      DatabaseError{"TooLong", "57014", Code::kUnavailable, "took too long", 1},
                      DatabaseError{"Locked", "55P03", Code::kUnavailable, "locked", 1},
                      DatabaseError{"Deadlock", "40P01", Code::kOk, "", 2},
                      DatabaseError{"ShuttingDown", "57P01", Code::kOk, "", 2},
                      DatabaseError{"ConnectionLost", "08006", Code::kOk, "", 2},
                      DatabaseError{"AnyOther", "XX000", Code::kInternal, "SQLSTATE XX000", 1}),
    [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace tissueform::testing
