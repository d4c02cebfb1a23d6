// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/deadline_timer.h"

#include <atomic>
#include <chrono>
#include <future>
#include <vector>

#include "gtest/gtest.h"

namespace tissueform {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;

DeadlineTimer::TimePoint Now() { return std::chrono::steady_clock::now(); }

TEST(DeadlineTimerTest, CallsInTheOrderOfTheDeadlinesAndNotBeforeThem) {
  std::vector<int> order;  // the timer's thread alone writes it
  std::promise<void> all;
  DeadlineTimer timer;
  const DeadlineTimer::TimePoint begin = Now();
  DeadlineTimer::TimePoint second_came;
  timer.Start(begin + milliseconds(30), [&] {
    order.push_back(3);
    all.set_value();
  });
  timer.Start(begin + milliseconds(20), [&] {
    order.push_back(2);
    second_came = Now();
  });
  timer.Start(begin - milliseconds(20), [&] { order.push_back(1); });
  all.get_future().wait();
  EXPECT_EQ(order, (std::vector<int>{1, 2, 3}));
  EXPECT_GE(second_came, begin + milliseconds(20));
}

TEST(DeadlineTimerTest, DoesNotCallACancelledCallback) {
  std::atomic<bool> called = false;
  DeadlineTimer timer;
  const DeadlineTimer::Id far = timer.Start(Now() + hours(1), [&] { called = true; });
  timer.Cancel(far);
  timer.Cancel(far);  // does no harm
  timer.Cancel(DeadlineTimer::Id());
  std::promise<void> later;
  timer.Start(Now(), [&] { later.set_value(); });
  later.get_future().wait();
  EXPECT_FALSE(called);
}

TEST(DeadlineTimerTest, CancelWaitsForACallThatHasBegun) {
  std::promise<void> begun;
  std::promise<void> go;
  std::atomic<bool> ended = false;
  DeadlineTimer timer;
  const DeadlineTimer::Id id = timer.Start(Now(), [&] {
    begun.set_value();
    go.get_future().wait();
    ended = true;
  });
  begun.get_future().wait();
  std::future<bool> cancelled = std::async(std::launch::async, [&] {
    timer.Cancel(id);
    return ended.load();
  });
  EXPECT_EQ(cancelled.wait_for(milliseconds(20)), std::future_status::timeout);
  go.set_value();
  EXPECT_TRUE(cancelled.get());
}

TEST(DeadlineTimerTest, ACallMayStartAnother) {
  std::promise<void> second;
  DeadlineTimer timer;
  timer.Start(Now(), [&] { timer.Start(Now(), [&] { second.set_value(); }); });
  EXPECT_EQ(second.get_future().wait_for(std::chrono::seconds(60)), std::future_status::ready);
}

}  // namespace
}  // namespace tissueform
