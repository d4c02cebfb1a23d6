// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/worker_pool.h"

#include <atomic>
#include <future>
#include <memory>
#include <vector>

#include "gtest/gtest.h"

namespace tissueform {
namespace {

TEST(WorkerPoolTest, RunsAllJobsBeforeItEnds) {
  std::atomic<int> count = 0;
  {
    WorkerPool pool(3);
    for (int i = 0; i < 100; ++i) {
      pool.Post([&count] { ++count; });
    }
  }
  EXPECT_EQ(count, 100);
}

TEST(WorkerPoolTest, JobsMayPostJobsWhileThePoolEnds) {
  std::atomic<int> count = 0;
  {
    WorkerPool pool(1);
    pool.Post([&] { pool.Post([&] { pool.Post([&count] { ++count; }); }); });
  }
  EXPECT_EQ(count, 1);
}

TEST(StrandTest, JobsRunOneAtATimeInOrder) {
  constexpr int kJobs = 500;
  std::vector<int> order;  // without a lock: the strand is the lock
  std::atomic<int> running = 0;
  std::atomic<bool> overlapped = false;
  {
    WorkerPool pool(4);
    Strand strand(&pool);
    for (int i = 0; i < kJobs; ++i) {
      strand.Post([&, i] {
        if (++running > 1) {
          overlapped = true;
        }
        order.push_back(i);
        --running;
      });
    }
  }
  EXPECT_FALSE(overlapped);
  ASSERT_EQ(order.size(), kJobs);
  for (int i = 0; i < kJobs; ++i) {
    EXPECT_EQ(order[i], i);
  }
}

TEST(StrandTest, ABusyStrandLetsOthersTakeTurns) {
  std::vector<char> order;  // one worker: no lock
  {
    WorkerPool pool(1);
    Strand busy(&pool);
    Strand other(&pool);
    std::promise<void> all_posted;
    pool.Post([future = all_posted.get_future().share()] { future.wait(); });
    for (int i = 0; i < 3; ++i) {
      busy.Post([&order] { order.push_back('b'); });
    }
    other.Post([&order] { order.push_back('o'); });
    all_posted.set_value();
  }
  EXPECT_EQ(order, (std::vector<char>{'b', 'o', 'b', 'b'}));
}

TEST(StrandTest, AJobMayHoldTheLastReferenceToItsStrand) {
  std::atomic<bool> ran = false;
  {
    WorkerPool pool(2);
    auto strand = std::make_shared<Strand>(&pool);
    Strand& posted_on = *strand;
    posted_on.Post([&ran, owner = std::move(strand)] { ran = true; });
  }
  EXPECT_TRUE(ran);
}

}  // namespace
}  // namespace tissueform
