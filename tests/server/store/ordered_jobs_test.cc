// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/ordered_jobs.h"

#include <atomic>
#include <future>
#include <map>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gtest/gtest.h"

#include "core/base/mutex.h"

namespace tissueform {
namespace {

TEST(OrderedJobsTest, JobsOfOneKeyRunInTheirOrder) {
  Mutex mutex;
  std::map<std::string, std::vector<int>> seen;
  {
    OrderedJobs jobs(3);
    for (int i = 0; i < 300; ++i) {
      const std::string key = absl::StrCat(i % 7);
      jobs.Submit(key, [&, key, i] {
        MutexLock lock(mutex);
        seen[key].push_back(i);
      });
    }
  }
  ASSERT_EQ(seen.size(), 7U);
  for (const auto& [key, numbers] : seen) {
    for (size_t i = 1; i < numbers.size(); ++i) EXPECT_EQ(numbers[i], numbers[i - 1] + 7) << key;
    EXPECT_GE(numbers.size(), 42U) << "what was submitted runs before the end";
  }
}

TEST(OrderedJobsTest, AJobThatWaitsHoldsUpItsOwnKeyAlone) {
  std::promise<void> released;
  std::shared_future<void> release = released.get_future().share();
  std::promise<void> other_ran;
  std::atomic<bool> signaled = false;
  OrderedJobs jobs(2);  // ends first: its last jobs use the rest
  jobs.Submit("a", [release] { release.wait(); });
  // Some key is on the other thread.
  for (int i = 0; i < 32; ++i) {
    jobs.Submit(absl::StrCat("b", i), [&] {
      if (!signaled.exchange(true)) other_ran.set_value();
    });
  }
  EXPECT_EQ(other_ran.get_future().wait_for(std::chrono::seconds(60)), std::future_status::ready);
  released.set_value();
}

}  // namespace
}  // namespace tissueform
