// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/stream_authorization.h"

#include <utility>

namespace tissueform {

StreamAuthorization::StreamAuthorization(DeadlineTimer* timer, std::chrono::milliseconds period,
                                         Check check, End end)
    : timer_(timer), period_(period), check_(std::move(check)), end_(std::move(end)) {}

void StreamAuthorization::Start() {
  MutexLock lock(mutex_);
  if (stopped_) return;
  next_ = timer_->Start(std::chrono::steady_clock::now() + period_, [this] { Recheck(); });
}

void StreamAuthorization::Recheck() {
  if (const absl::Status status = check_(); status.ok()) {
    Start();
  } else {
    end_(status);
  }
}

void StreamAuthorization::Stop() {
  DeadlineTimer::Id next;
  {
    MutexLock lock(mutex_);
    stopped_ = true;
    next = next_;
  }
  timer_->Cancel(next);
}

}  // namespace tissueform
