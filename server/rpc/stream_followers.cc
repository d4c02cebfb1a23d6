// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/stream_followers.h"

#include <chrono>
#include <utility>

namespace tissueform {

StreamFollowers::StreamFollowers(DeadlineTimer* timer, OnCount on_count)
    : timer_(timer), on_count_(std::move(on_count)) {}

void StreamFollowers::FollowersChanged(int count) {
  MutexLock lock(mutex_);
  count_ = count;
  if (std::exchange(is_due_, true)) return;
  due_ = timer_->Start(std::chrono::steady_clock::now(), [this] { ReportNews(); });
}

// Until there is nothing new: one call at a time is under way, the one that Stop waits for.
void StreamFollowers::ReportNews() {
  while (true) {
    int count = 0;
    {
      MutexLock lock(mutex_);
      is_due_ = count_ != reported_;
      if (!is_due_) return;
      count = reported_ = count_;
    }
    on_count_(count);
  }
}

void StreamFollowers::Stop() {
  DeadlineTimer::Id due;
  {
    MutexLock lock(mutex_);
    due = due_;
  }
  timer_->Cancel(due);
}

}  // namespace tissueform
