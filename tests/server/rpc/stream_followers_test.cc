// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/stream_followers.h"

#include <chrono>
#include <future>
#include <thread>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class StreamFollowersTest : public ::testing::Test {
 protected:
  // Returns when everything that was due before has been called.
  void WaitForTimer() {
    std::promise<void> reached;
    timer_.Start(std::chrono::steady_clock::now(), [&] { reached.set_value(); });
    reached.get_future().wait();
  }

  DeadlineTimer timer_;
  std::vector<int> reported_;  // of the timer's thread
};

TEST_F(StreamFollowersTest, ReportsEveryChangedNumberOnce) {
  StreamFollowers followers(&timer_, [this](int count) { reported_.push_back(count); });
  for (const int count : {0, 2, 2, 1, 0, 0}) {
    followers.FollowersChanged(count);
    WaitForTimer();
  }
  followers.Stop();
  EXPECT_THAT(reported_, ElementsAre(2, 1, 0));
}

TEST_F(StreamFollowersTest, ReportsTheNewestNumberThatChangesDuringAReport) {
  std::promise<void> reporting;
  std::promise<void> go_on;
  StreamFollowers followers(&timer_, [&](int count) {
    reported_.push_back(count);
    if (count != 1) return;
    reporting.set_value();
    go_on.get_future().wait();
  });
  followers.FollowersChanged(1);
  reporting.get_future().wait();
  followers.FollowersChanged(2);
  followers.FollowersChanged(3);
  go_on.set_value();
  WaitForTimer();
  followers.Stop();
  EXPECT_THAT(reported_, ElementsAre(1, 3));
}

TEST_F(StreamFollowersTest, StoppingWaitsForAReportUnderWay) {
  std::promise<void> reporting;
  bool has_reported = false;
  StreamFollowers followers(&timer_, [&](int /*count*/) {
    reporting.set_value();
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    has_reported = true;
  });
  followers.FollowersChanged(1);
  reporting.get_future().wait();
  followers.Stop();
  EXPECT_TRUE(has_reported);
}

TEST_F(StreamFollowersTest, ReportsNothingWithoutFollowers) {
  StreamFollowers followers(&timer_, [this](int count) { reported_.push_back(count); });
  followers.Stop();
  EXPECT_THAT(reported_, IsEmpty());
}

}  // namespace
}  // namespace tissueform
