// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/stream_followers.h"

#include <chrono>
#include <utility>

namespace tissueform {

StreamFollowers::StreamFollowers(DeadlineTimer* timer, Tell tell)
    : timer_(timer), tell_(std::move(tell)) {}

void StreamFollowers::FollowersChanged(int count) {
  MutexLock lock(mutex_);
  count_ = count;
  if (std::exchange(is_due_, true)) return;
  due_ = timer_->Start(std::chrono::steady_clock::now(), [this] { TellNews(); });
}

// Until there is nothing new: one call at a time is under way, the one that Stop waits for.
void StreamFollowers::TellNews() {
  while (true) {
    int count = 0;
    {
      MutexLock lock(mutex_);
      is_due_ = count_ != told_;
      if (!is_due_) return;
      count = told_ = count_;
    }
    tell_(count);
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
