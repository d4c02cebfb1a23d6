// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/worker_pool.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <future>
#include <map>
#include <memory>
#include <numeric>
#include <unistd.h>
#include <vector>

#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "gtest/gtest.h"
#include <sys/resource.h>

namespace tissueform {
namespace {

TEST(WorkerPoolTest, RunsAllJobsBeforeItEnds) {
  std::atomic<int> count = 0;
  {
    WorkerPool pool(3);
    for (int i = 0; i < 100; ++i) {
      pool.Post(Lane::kBatch, [&count] { ++count; });
    }
  }
  EXPECT_EQ(count, 100);
}

TEST(WorkerPoolTest, JobsMayPostJobsWhileThePoolEnds) {
  std::atomic<int> count = 0;
  {
    WorkerPool pool(1);
    pool.Post(Lane::kBatch, [&] {
      pool.Post(Lane::kBatch, [&] { pool.Post(Lane::kBatch, [&count] { ++count; }); });
    });
  }
  EXPECT_EQ(count, 1);
}

TEST(WorkerPoolTest, NoLaneWaitsForAnother) {
  for (size_t busy = 0; busy < kNumLanes; ++busy) {
    WorkerPool pool(2);
    std::promise<void> end;
    const std::shared_future<void> ended = end.get_future().share();
    // More than the lane has threads for: some wait.
    for (int i = 0; i < 5; ++i) pool.Post(static_cast<Lane>(busy), [ended] { ended.wait(); });
    for (size_t lane = 0; lane < kNumLanes; ++lane) {
      if (lane == busy) continue;
      std::promise<void> ran;
      pool.Post(static_cast<Lane>(lane), [&ran] { ran.set_value(); });
      EXPECT_EQ(ran.get_future().wait_for(std::chrono::seconds(60)), std::future_status::ready)
          << "lane " << lane << " waits for lane " << busy;
    }
    end.set_value();
  }
}

TEST(WorkerPoolTest, MeasuresWaitingAndRunningOfEachLane) {
  WorkerPool pool(1);
  std::promise<void> end;
  std::promise<void> started;
  const std::shared_future<void> ended = end.get_future().share();
  pool.Post(Lane::kSolves, [ended, &started] {
    started.set_value();
    ended.wait();
  });
  started.get_future().wait();
  Strand strand(&pool);
  std::promise<void> last;
  for (int i = 0; i < 3; ++i) strand.Post(Lane::kSolves, [] {});
  EXPECT_EQ(pool.CountQueued(Lane::kSolves), 1) << "of a strand one at a time";
  EXPECT_EQ(pool.CountQueued(Lane::kBatch), 0);
  end.set_value();
  strand.Post(Lane::kBatch, [&last] { last.set_value(); });
  last.get_future().wait();
  const auto count = [](const DurationHistogram& histogram) {
    const auto counts = histogram.Read().counts;
    return std::accumulate(counts.begin(), counts.end(), uint64_t{0});
  };
  EXPECT_EQ(count(pool.measures(Lane::kSolves).waited), 4);
  // A strand's next job may begin before the time of the one before it is taken.
  const auto ran = [&] { return count(pool.measures(Lane::kSolves).ran); };
  for (int i = 0; i < 1000 && ran() < 4; ++i) absl::SleepFor(absl::Milliseconds(10));
  EXPECT_EQ(ran(), 4);
  EXPECT_EQ(count(pool.measures(Lane::kBatch).waited), 1);
}

TEST(WorkerPoolTest, LaterLanesLeaveTheProcessorsToEarlierOnes) {
  std::map<Lane, int> niceness;
  for (const Lane lane : {Lane::kFrames, Lane::kSolves, Lane::kIterations, Lane::kBatch}) {
    WorkerPool pool(1);
    pool.Post(lane, [&niceness, lane] {
      niceness[lane] = getpriority(PRIO_PROCESS, static_cast<id_t>(gettid()));
    });
  }
  EXPECT_EQ(niceness[Lane::kFrames], getpriority(PRIO_PROCESS, 0));
  EXPECT_LT(niceness[Lane::kFrames], niceness[Lane::kSolves]);
  EXPECT_LT(niceness[Lane::kSolves], niceness[Lane::kIterations]);
  EXPECT_LT(niceness[Lane::kIterations], niceness[Lane::kBatch]);
}

TEST(StrandTest, JobsOfDifferentLanesStillRunOneAtATimeInOrder) {
  std::vector<int> order;  // without a lock: the strand is the lock
  {
    WorkerPool pool(2);
    Strand strand(&pool);
    for (int i = 0; i < 200; ++i) {
      strand.Post(static_cast<Lane>(i % kNumLanes), [&order, i] { order.push_back(i); });
    }
  }
  ASSERT_EQ(order.size(), 200);
  EXPECT_TRUE(std::is_sorted(order.begin(), order.end()));
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
      strand.Post(Lane::kBatch, [&, i] {
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
    pool.Post(Lane::kBatch, [future = all_posted.get_future().share()] { future.wait(); });
    for (int i = 0; i < 3; ++i) {
      busy.Post(Lane::kBatch, [&order] { order.push_back('b'); });
    }
    other.Post(Lane::kBatch, [&order] { order.push_back('o'); });
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
    posted_on.Post(Lane::kBatch, [&ran, owner = std::move(strand)] { ran = true; });
  }
  EXPECT_TRUE(ran);
}

TEST(WorkerPoolTest, AJobKnowsHowLongItHasWaited) {
  WorkerPool pool(1);
  std::promise<std::chrono::steady_clock::duration> waited;
  pool.Post(
      Lane::kStore, [&waited] { waited.set_value(WorkerPool::Waited()); },
      std::chrono::steady_clock::now() - std::chrono::hours(1));
  EXPECT_GE(waited.get_future().get(), std::chrono::hours(1));
  EXPECT_EQ(WorkerPool::Waited().count(), 0) << "this thread runs none";
}

}  // namespace
}  // namespace tissueform
