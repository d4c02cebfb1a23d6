// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/lease_keeper.h"

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/server/store/postgres_store/lease_steps.h"
#include "tests/server/store/postgres_store/model_leases.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using std::chrono::seconds;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class LeaseKeeperTest : public ::testing::Test {
 protected:
  LeaseKeeperTest() {
    store_.sessions["s"] = {};
    store_.sessions["t"] = {};
  }

  ModelStore store_;
  ModelLeases leases_{&store_, "A"};
  ModelLeases others_{&store_, "B"};
  std::vector<std::string> lost_;
  LeaseKeeper keeper_{&leases_,
                      {.clock = [this] { return store_.now; }},
                      [this](const SessionLease& lease) { lost_.push_back(lease.session); }};
};

TEST_F(LeaseKeeperTest, AcquiredSessionIsUsableUntilShortlyBeforeItsLeaseEnds) {
  EXPECT_EQ(keeper_.EpochOf("s"), std::nullopt);
  ASSERT_OK_AND_ASSIGN(const LeaseAnswer answer, keeper_.Acquire("s"));
  EXPECT_TRUE(answer.mine);
  EXPECT_EQ(keeper_.EpochOf("s"), 3);
  store_.now += seconds(8);
  EXPECT_EQ(keeper_.EpochOf("s"), 3);
  store_.now += seconds(1);
  EXPECT_EQ(keeper_.EpochOf("s"), std::nullopt) << "a second before";
}

TEST(LeaseClockTest, IsNeverBehindAClockThatPausesDuringSleep) {
  const auto before = std::chrono::steady_clock::now();
  const auto now = AwakeOrNotNow();
  EXPECT_GE(now, before);
  EXPECT_GE(AwakeOrNotNow(), now);
}

TEST_F(LeaseKeeperTest, RenewedSessionKeepsItsEpoch) {
  ASSERT_THAT(keeper_.Acquire("s"), IsOk());
  for (int i = 0; i < 5; ++i) {
    store_.now += seconds(3);
    ASSERT_THAT(keeper_.Renew(), IsOk());
    EXPECT_EQ(keeper_.EpochOf("s"), 3);
  }
  EXPECT_THAT(lost_, IsEmpty());
}

TEST_F(LeaseKeeperTest, ReportsATakenOverSessionAsLostOnce) {
  ASSERT_THAT(keeper_.Acquire("s"), IsOk());
  ASSERT_THAT(keeper_.Acquire("t"), IsOk());
  store_.now += seconds(11);
  ASSERT_OK_AND_ASSIGN(const LeaseAnswer taken, others_.Acquire("s"));
  EXPECT_TRUE(taken.mine);
  ASSERT_THAT(keeper_.Renew(), IsOk());
  EXPECT_THAT(lost_, ElementsAre("s", "t")) << "what has run out is lost, too";
  ASSERT_THAT(keeper_.Renew(), IsOk());
  EXPECT_EQ(lost_.size(), 2U);
  ASSERT_OK_AND_ASSIGN(const LeaseAnswer answer, keeper_.Acquire("s"));
  EXPECT_FALSE(answer.mine);
  EXPECT_EQ(answer.node, "B");
}

TEST_F(LeaseKeeperTest, UnavailableStoreCostsASessionOnlyAfterItsLease) {
  ASSERT_THAT(keeper_.Acquire("s"), IsOk());
  store_.failure = absl::UnavailableError("gone");
  store_.now += seconds(6);
  EXPECT_THAT(keeper_.Renew(), StatusIs(absl::StatusCode::kUnavailable));
  EXPECT_EQ(keeper_.EpochOf("s"), 3);
  EXPECT_THAT(lost_, IsEmpty());
  store_.now += seconds(3);
  EXPECT_THAT(keeper_.Renew(), StatusIs(absl::StatusCode::kUnavailable));
  EXPECT_THAT(lost_, ElementsAre("s"));
}

TEST_F(LeaseKeeperTest, DoesNotAnswerAfterAnExpiredLeaseEvenIfUntaken) {
  ASSERT_THAT(keeper_.Acquire("s"), IsOk());
  store_.now += seconds(60);
  EXPECT_EQ(keeper_.EpochOf("s"), std::nullopt);
  ASSERT_OK_AND_ASSIGN(const LeaseAnswer again, keeper_.Acquire("s"));
  EXPECT_EQ(again.lease.epoch, 4);
  EXPECT_THAT(lost_, ElementsAre("s")) << "what was made under the epoch before is not trusted";
  EXPECT_EQ(keeper_.EpochOf("s"), 4);
}

TEST_F(LeaseKeeperTest, FailsFastWhileTheStoreIsUnavailable) {
  class Counted final : public SessionLeases {
   public:
    explicit Counted(SessionLeases* leases) : leases_(*leases) {}
    absl::StatusOr<LeaseAnswer> Acquire(const std::string& session) override {
      ++calls;
      return leases_.Acquire(session);
    }
    absl::StatusOr<std::vector<SessionLease>> Renew() override {
      ++calls;
      return leases_.Renew();
    }
    absl::Status Release(const std::string& session, int64_t epoch) override {
      ++calls;
      return leases_.Release(session, epoch);
    }

    int calls = 0;

   private:
    SessionLeases& leases_;
  } counted(&leases_);
  LeaseKeeper keeper(&counted, {.clock = [this] { return store_.now; }},
                     [](const SessionLease&) {});
  ASSERT_THAT(keeper.Acquire("s"), IsOk());
  store_.failure = absl::UnavailableError("gone");
  counted.calls = 0;
  const auto gone = StatusIs(absl::StatusCode::kUnavailable, HasSubstr("gone"));
  EXPECT_THAT(keeper.Acquire("t"), gone);
  EXPECT_THAT(keeper.Acquire("t"), gone);
  EXPECT_THAT(keeper.Release("s"), gone);
  EXPECT_EQ(counted.calls, 1);
  EXPECT_THAT(keeper.Renew(), gone);
  EXPECT_EQ(counted.calls, 2) << "a renewal is tried all the same";
  store_.failure = absl::OkStatus();
  EXPECT_THAT(keeper.Acquire("t"), gone) << "not yet";
  store_.now += seconds(1);
  EXPECT_THAT(keeper.Acquire("t"), IsOk());
  store_.failure = absl::UnavailableError("gone");
  EXPECT_THAT(keeper.Renew(), gone);
  store_.failure = absl::OkStatus();
  EXPECT_THAT(keeper.Renew(), IsOk());
  EXPECT_THAT(keeper.Acquire("u"), StatusIs(absl::StatusCode::kNotFound)) << "it answers again";
}

TEST_F(LeaseKeeperTest, RenewsASkippedSessionSoon) {
  class Writing final : public SessionLeases {
   public:
    explicit Writing(SessionLeases* leases) : leases_(*leases) {}
    absl::StatusOr<LeaseAnswer> Acquire(const std::string& session) override {
      return leases_.Acquire(session);
    }
    absl::StatusOr<std::vector<SessionLease>> Renew() override {
      if (written.empty()) return leases_.Renew();
      return std::vector<SessionLease>{{.session = written, .epoch = 3}};
    }
    absl::Status Release(const std::string& session, int64_t epoch) override {
      return leases_.Release(session, epoch);
    }

    std::string written;  // at this moment

   private:
    SessionLeases& leases_;
  } leases(&leases_);
  const LeaseKeeper::Options options = {.clock = [this] { return store_.now; }};
  LeaseKeeper keeper(&leases, options, [](const SessionLease&) {});
  ASSERT_THAT(keeper.Acquire("s"), IsOk());
  store_.now += seconds(3);
  EXPECT_EQ(keeper.Renew().value(), options.renew_every);
  store_.now += seconds(3);
  leases.written = "s";
  EXPECT_EQ(keeper.Renew().value(), options.again);
  store_.now += seconds(5);
  EXPECT_EQ(keeper.EpochOf("s"), 3) << "the lease from before";
  leases.written.clear();
  EXPECT_EQ(keeper.Renew().value(), options.renew_every);
  store_.now += seconds(8);
  EXPECT_EQ(keeper.EpochOf("s"), 3);
}

TEST_F(LeaseKeeperTest, OthersMayTakeAReleasedSessionAtOnce) {
  ASSERT_THAT(keeper_.Acquire("s"), IsOk());
  ASSERT_THAT(keeper_.Acquire("t"), IsOk());
  ASSERT_THAT(keeper_.ReleaseAll(), IsOk());
  EXPECT_EQ(keeper_.EpochOf("s"), std::nullopt);
  for (const char* session : {"s", "t"}) {
    ASSERT_OK_AND_ASSIGN(const LeaseAnswer answer, others_.Acquire(session));
    EXPECT_TRUE(answer.mine);
  }
}

TEST_F(LeaseKeeperTest, ASessionThatWasAcquiredWithoutAnAnswerIsGivenBack) {
  ASSERT_THAT(leases_.Acquire("s"), IsOk());  // as if its answer had been lost
  ASSERT_THAT(keeper_.Renew(), IsOk());
  ASSERT_OK_AND_ASSIGN(const LeaseAnswer answer, others_.Acquire("s"));
  EXPECT_TRUE(answer.mine);
  EXPECT_THAT(keeper_.Acquire("u"), StatusIs(absl::StatusCode::kNotFound));
}

TEST_F(LeaseKeeperTest, AThreadRenewsUntilTheEnd) {
  ModelStore store;
  store.sessions["s"] = {};
  class Counted final : public SessionLeases {
   public:
    absl::StatusOr<LeaseAnswer> Acquire(const std::string&) override { return LeaseAnswer{}; }
    absl::StatusOr<std::vector<SessionLease>> Renew() override {
      MutexLock lock(mutex);
      ++renewals;
      changed.NotifyAll();
      return std::vector<SessionLease>();
    }
    absl::Status Release(const std::string&, int64_t) override { return absl::OkStatus(); }

    Mutex mutex;
    ConditionVariable changed;
    int renewals ABSL_GUARDED_BY(mutex) = 0;
  } counted;
  LeaseKeeper keeper(&counted, {.renew_every = std::chrono::milliseconds(1)},
                     [](const SessionLease&) {});
  keeper.Start();
  MutexLock lock(counted.mutex);
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (counted.renewals < 3 && counted.changed.WaitUntil(counted.mutex, deadline)) {
  }
  EXPECT_GE(counted.renewals, 3);
}

// Holds for all actions of two servers in any order: see each assertion.
void CheckRules(LeaseServers& servers, const LeaseSteps& steps) {
  ASSERT_FALSE(servers.MayAnswer(0) && servers.MayAnswer(1)) << ToString(steps);
  std::map<int64_t, int> writers;
  for (const LeaseServers::Write& write : servers.writes()) {
    ASSERT_EQ(write.epoch, write.newest_epoch) << "a write under an old epoch: " << ToString(steps);
    ASSERT_EQ(writers.emplace(write.epoch, write.server).first->second, write.server)
        << "an epoch of two servers: " << ToString(steps);
  }
}

void CheckAllOrders(const LeaseSteps& all, size_t depth, LeaseSteps* steps) {
  ModelLeaseWorld world;
  LeaseServers servers(&world);
  std::string seen;
  for (const LeaseStep& step : *steps) {
    seen = servers.Take(step);
    ASSERT_THAT(seen, ::testing::Not(HasSubstr("not greater"))) << ToString(*steps);
    if (step.action == LeaseAction::kCommit || step.action == LeaseAction::kDelete) {
      ASSERT_THAT(seen, ::testing::Not(HasSubstr("refused")))
          << "who may answer writes: " << ToString(*steps);
    }
  }
  ASSERT_NO_FATAL_FAILURE(CheckRules(servers, *steps));
  // A step that did nothing changes nothing: the order without it goes on from here.
  const bool is_nothing = absl::StrContains(seen, ": may not") ||
                          absl::StrContains(seen, ": has none") ||
                          absl::StrContains(seen, ": is there");
  if (steps->size() == depth || is_nothing) return;
  for (const LeaseStep& step : all) {
    steps->push_back(step);
    ASSERT_NO_FATAL_FAILURE(CheckAllOrders(all, depth, steps));
    steps->pop_back();
  }
}

TEST(LeaseOrdersTest, NoOrderOfSixStepsLetsTwoServersShareAnEpoch) {
  LeaseSteps steps;
  CheckAllOrders(PromptLeaseSteps(), 6, &steps);
}

TEST(LeaseOrdersTest, NoOrderOfFourDelayedStepsLetsTwoServersShareAnEpoch) {
  LeaseSteps steps;
  CheckAllOrders(AllLeaseSteps(), 4, &steps);
}

}  // namespace
}  // namespace tissueform::testing
