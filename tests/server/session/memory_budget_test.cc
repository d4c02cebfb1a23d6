// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/memory_budget.h"

#include <atomic>
#include <functional>
#include <future>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/error_reason.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::StatusIs;

constexpr int64_t kMebibyte = 1 << 20;

// Answers shortages as long as it lives.
class Reclaiming {
 public:
  using Reclaim = std::function<void(const MemoryBudget::Shortage& shortage)>;

  Reclaiming(MemoryBudget* budget, Reclaim reclaim)
      : budget_(budget), reclaim_(std::move(reclaim)) {
    budget_->BeginReclaiming();
    thread_ = std::thread([this] {
      while (const auto shortage = budget_->WaitForShortage()) {
        reclaim_(*shortage);
        budget_->AnswerShortage();
      }
    });
  }
  ~Reclaiming() {
    budget_->EndReclaiming();
    thread_.join();
  }
  Reclaiming(const Reclaiming&) = delete;
  Reclaiming& operator=(const Reclaiming&) = delete;

 private:
  MemoryBudget* const budget_;
  const Reclaim reclaim_;
  std::thread thread_;
};

TEST(MemoryBudgetTest, ReservationsAreGivenBackOnce) {
  MemoryBudget budget(100);
  {
    ASSERT_OK_AND_ASSIGN(MemoryReservation first, budget.Reserve(60, "mesh"));
    MemoryReservation moved = std::move(first);
    EXPECT_EQ(moved.bytes(), 60);
    EXPECT_EQ(budget.reserved_bytes(), 60);
  }
  EXPECT_EQ(budget.reserved_bytes(), 0);
}

TEST(MemoryBudgetTest, AssigningGivesBackTheOldReservation) {
  MemoryBudget budget(100);
  ASSERT_OK_AND_ASSIGN(MemoryReservation reservation, budget.Reserve(60, "mesh"));
  reservation = MemoryReservation();
  EXPECT_EQ(budget.reserved_bytes(), 0);
}

TEST(MemoryBudgetTest, TheLimitIsInclusive) {
  MemoryBudget budget(100);
  EXPECT_THAT(budget.Reserve(100, "mesh"), IsOk());
  EXPECT_FALSE(budget.Reserve(101, "mesh").ok());
  EXPECT_EQ(budget.reserved_bytes(), 0);
}

TEST(MemoryBudgetTest, RefusalStatesRequestedTakenAndAllowedBytes) {
  MemoryBudget budget(10 * kMebibyte);
  ASSERT_OK_AND_ASSIGN(const MemoryReservation taken, budget.Reserve(4 * kMebibyte, "mesh"));
  EXPECT_THAT(budget.Reserve(7 * kMebibyte, "matrix factor"),
              StatusIs(absl::StatusCode::kResourceExhausted,
                       AllOf(HasSubstr("matrix factor"), HasSubstr("7.0 MiB"), HasSubstr("4.0 MiB"),
                             HasSubstr("10.0 MiB"))));
}

TEST(MemoryBudgetTest, ARefusedResizeKeepsTheReservation) {
  MemoryBudget budget(100);
  ASSERT_OK_AND_ASSIGN(MemoryReservation reservation, budget.Reserve(60, "session"));
  EXPECT_FALSE(reservation.Resize(101, "factor").ok());
  EXPECT_EQ(reservation.bytes(), 60);
  EXPECT_THAT(reservation.Resize(100, "factor"), IsOk());
  EXPECT_THAT(reservation.Resize(10, "factor"), IsOk());
  EXPECT_EQ(budget.reserved_bytes(), 10);
}

TEST(MemoryBudgetTest, ReclaimingMakesRoomForOneMoreTry) {
  MemoryBudget budget(100);
  MemoryReservation idle;
  int calls = 0;
  const Reclaiming reclaiming(&budget, [&](const MemoryBudget::Shortage& shortage) {
    EXPECT_EQ(shortage.bytes, 90);
    ++calls;
    idle = MemoryReservation();
  });
  ASSERT_OK_AND_ASSIGN(idle, budget.Reserve(80, "idle"));
  EXPECT_EQ(calls, 0);
  ASSERT_OK_AND_ASSIGN(const MemoryReservation fresh, budget.Reserve(90, "fresh"));
  EXPECT_EQ(calls, 1);
  EXPECT_EQ(budget.reserved_bytes(), 90);
}

TEST(MemoryBudgetTest, ReservationsThatAreShortAtTheSameTimeDoNotGetTheSameRoom) {
  MemoryBudget budget(100);
  std::vector<MemoryReservation> idle;
  idle.push_back(*budget.Reserve(50, "idle"));
  idle.push_back(*budget.Reserve(50, "idle"));
  budget.BeginReclaiming();
  const auto reserve = [&] { return budget.Reserve(50, "fresh"); };
  auto first = std::async(std::launch::async, reserve);
  auto second = std::async(std::launch::async, reserve);
  for (int shortage = 0; shortage < 2; ++shortage) {
    const int64_t bytes = budget.WaitForShortage()->bytes;
    // No more than is needed.
    while (!idle.empty() && budget.reserved_bytes() + bytes > budget.limit_bytes()) idle.pop_back();
    budget.AnswerShortage();
  }
  EXPECT_THAT(first.get(), IsOk());
  EXPECT_THAT(second.get(), IsOk());
  budget.EndReclaiming();
}

TEST(MemoryBudgetTest, AReservationThatWaitsIsRefusedWhenReclaimingEnds) {
  MemoryBudget budget(100);
  budget.BeginReclaiming();
  std::future<bool> reserved =
      std::async(std::launch::async, [&] { return budget.Reserve(101, "too much").ok(); });
  EXPECT_EQ(budget.WaitForShortage()->bytes, 101);
  budget.EndReclaiming();
  EXPECT_FALSE(reserved.get());
  EXPECT_FALSE(budget.WaitForShortage().has_value());
  EXPECT_FALSE(budget.Reserve(101, "too much").ok()) << "at once";
}

TEST(MemoryBudgetTest, ThreadsNeverExceedTheBudget) {
  MemoryBudget budget(8);
  std::atomic<bool> exceeded = false;
  constexpr int kThreads = 4;
  std::vector<std::thread> threads;
  threads.reserve(kThreads);
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < 1000; ++i) {
        const auto reservation = budget.Reserve(3, "test");
        if (budget.reserved_bytes() > budget.limit_bytes()) {
          exceeded = true;
        }
      }
    });
  }
  for (std::thread& thread : threads) {
    thread.join();
  }
  EXPECT_FALSE(exceeded);
  EXPECT_EQ(budget.reserved_bytes(), 0);
}

TEST(MemoryBudgetTest, AnOwnerHasAPartOfTheWholeAndTakesNothingFromAnother) {
  MemoryBudget budget(100);
  std::vector<std::string> asked;
  budget.set_account_limit(60);
  const Reclaiming reclaiming(
      &budget, [&](const MemoryBudget::Shortage& shortage) { asked.push_back(shortage.owner); });
  MemoryBudget* one = budget.AccountOf("one");
  EXPECT_EQ(one, budget.AccountOf("one"));
  EXPECT_EQ(budget.AccountOf(""), &budget) << "nobody's share is the whole";
  ASSERT_OK_AND_ASSIGN(MemoryReservation first, one->Reserve(50, "session"));
  EXPECT_EQ(budget.reserved_bytes(), 50);
  const absl::Status over = first.Resize(61, "factor");
  EXPECT_EQ(ReasonOf(over), "QUOTA_EXCEEDED");
  EXPECT_EQ(ErrorInfoOf(over).metadata.at("quota"), "memory-mib");
  EXPECT_THAT(asked, ElementsAre("one"));
  ASSERT_OK_AND_ASSIGN(const MemoryReservation second, budget.AccountOf("two")->Reserve(50, "s"));
  const absl::Status full = first.Resize(60, "factor");
  EXPECT_EQ(ReasonOf(full), "MEMORY_BUDGET_FULL") << "of all, not of the owner";
  EXPECT_EQ(one->reserved_bytes(), 50) << "nothing is left of what was refused";
  EXPECT_EQ(budget.reserved_bytes(), 100);
  EXPECT_THAT(first.Resize(10, "session"), IsOk());
  EXPECT_EQ(one->reserved_bytes(), 10);
  EXPECT_EQ(budget.reserved_bytes(), 60);
}

TEST(MemoryBudgetTest, BytesThatAnOwnerReleasesMakeRoomForTheSameOwner) {
  MemoryBudget budget(100);
  MemoryReservation idle;
  budget.set_account_limit(60);
  const Reclaiming reclaiming(
      &budget, [&](const MemoryBudget::Shortage& /*shortage*/) { idle = MemoryReservation(); });
  MemoryBudget* one = budget.AccountOf("one");
  ASSERT_OK_AND_ASSIGN(idle, one->Reserve(40, "idle"));
  ASSERT_OK_AND_ASSIGN(const MemoryReservation fresh, one->Reserve(50, "fresh"));
  EXPECT_EQ(one->reserved_bytes(), 50);
  EXPECT_EQ(budget.reserved_bytes(), 50);
}

TEST(MemoryBudgetTest, RemembersThePeakReservation) {
  MemoryBudget budget(100);
  {
    const MemoryReservation first = *budget.Reserve(40, "first");
    const MemoryReservation second = *budget.Reserve(30, "second");
    EXPECT_FALSE(budget.Reserve(31, "third").ok());
  }
  const MemoryReservation later = *budget.Reserve(20, "later");
  EXPECT_EQ(budget.reserved_bytes(), 20);
  EXPECT_EQ(budget.most_reserved_bytes(), 70);
}

}  // namespace
}  // namespace tissueform
