// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <thread>
#include <utility>

#include "core/base/mutex.h"

namespace tissueform {

// Notifies waiters that the time of their client is over. One thread of its own.
//
// Thread-safe.
class DeadlineTimer {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;
  using Expired = std::function<void()>;
  using Id = std::pair<TimePoint, uint64_t>;

  DeadlineTimer();
  // REQUIRES: all that was started was cancelled.
  ~DeadlineTimer();
  DeadlineTimer(const DeadlineTimer&) = delete;
  DeadlineTimer& operator=(const DeadlineTimer&) = delete;

  // Calls `expired` once at the deadline, or as soon after it as the others' calls allow: it must
  // not take long. It may call Start.
  Id Start(TimePoint deadline, Expired expired);
  // Once it has returned, `expired` neither runs nor will. Not from within `expired`, and not
  // while holding a lock that it takes. Id(), which Start never gives, is nothing.
  void Cancel(Id id);

 private:
  void Wait();

  Mutex mutex_;
  ConditionVariable changed_;
  std::map<Id, Expired> waiting_ ABSL_GUARDED_BY(mutex_);
  Id running_ ABSL_GUARDED_BY(mutex_);
  uint64_t last_ ABSL_GUARDED_BY(mutex_) = 0;
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;

  std::thread thread_;
};

}  // namespace tissueform
