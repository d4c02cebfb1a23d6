// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/duration_histogram.h"

#include <chrono>
#include <numeric>
#include <thread>
#include <vector>

#include "gtest/gtest.h"

namespace tissueform {
namespace {

using std::chrono::microseconds;

TEST(DurationHistogramTest, ABoundBelongsToItsOwnBucket) {
  DurationHistogram histogram;
  histogram.Observe(microseconds(100));
  histogram.Observe(microseconds(101));
  histogram.Observe(std::chrono::hours(1));
  histogram.Observe(-microseconds(5));
  const DurationHistogram::Snapshot snapshot = histogram.Read();
  EXPECT_EQ(snapshot.counts.front(), 2);
  EXPECT_EQ(snapshot.counts[1], 1);
  EXPECT_EQ(snapshot.counts.back(), 1);
  EXPECT_NEAR(snapshot.sum_seconds, 3600 + 201e-6, 1e-9);
}

TEST(DurationHistogramTest, NoObservationIsLostBetweenThreads) {
  DurationHistogram histogram;
  std::vector<std::thread> threads;
  threads.reserve(4);
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&histogram] {
      for (int j = 0; j < 10'000; ++j) histogram.Observe(microseconds(j));
    });
  }
  for (std::thread& thread : threads) thread.join();
  const DurationHistogram::Snapshot snapshot = histogram.Read();
  EXPECT_EQ(std::accumulate(snapshot.counts.begin(), snapshot.counts.end(), uint64_t{0}), 40'000);
  EXPECT_NEAR(snapshot.sum_seconds, 4 * 1e-6 * 10'000 * 9'999 / 2, 1e-6);
}

}  // namespace
}  // namespace tissueform
