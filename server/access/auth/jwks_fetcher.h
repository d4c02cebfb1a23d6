// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <string>
#include <thread>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/mutex.h"

namespace tissueform {

// That a URL is https, or http of this machine, and brings no password. Errors: InvalidArgument.
absl::Status CheckJwksUrl(const std::string& url);

// Asks this URL and no other: follows no redirects, uses no proxy, takes 1 MiB at most, ends
// within 10 s, and within a second once `stopping`. Blocks.
//
// Errors: Unavailable, without the URL. REQUIRES: CheckJwksUrl.
absl::StatusOr<std::string> DownloadJwks(const std::string& url, const std::atomic<bool>& stopping);

// When a URL is asked for its keys.
struct JwksTimes {
  std::chrono::milliseconds refresh = std::chrono::minutes(15);
  // After a request that failed or returned an unusable answer.
  std::chrono::milliseconds retry = std::chrono::seconds(30);
  // Between two requests, however often callers bring an unknown key.
  std::chrono::milliseconds least = std::chrono::seconds(10);
};

// Asks again and again, on a thread of its own.
class JwksFetcher {
 public:
  // By the fetcher's thread. Whether what came is of use.
  using Take = std::function<bool(const absl::StatusOr<std::string>& answer)>;

  // It was asked just now; `asked_well`: with an answer that is of use.
  JwksFetcher(std::string url, const JwksTimes& times, bool asked_well, Take take);
  ~JwksFetcher();
  JwksFetcher(const JwksFetcher&) = delete;
  JwksFetcher& operator=(const JwksFetcher&) = delete;

  // Soon, as the times allow. Returns at once; any thread.
  void Ask();

 private:
  using TimePoint = std::chrono::steady_clock::time_point;

  void Run();
  // Waits for the next time; false when it ends.
  bool WaitUntilDue();

  const std::string url_;
  const JwksTimes times_;
  const Take take_;
  std::atomic<bool> stopping_ = false;

  Mutex mutex_;
  ConditionVariable changed_;
  bool asked_ ABSL_GUARDED_BY(mutex_) = false;
  TimePoint last_ ABSL_GUARDED_BY(mutex_);
  TimePoint next_ ABSL_GUARDED_BY(mutex_);
  std::thread thread_;
};

}  // namespace tissueform
