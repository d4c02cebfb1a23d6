// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/stream_authorization.h"

#include <utility>

namespace tissueform {

StreamAuthorization::StreamAuthorization(DeadlineTimer* timer, WorkerPool* pool,
                                         std::chrono::milliseconds period, MakeQuestion make,
                                         End end)
    : timer_(timer), pool_(pool), period_(period), make_(std::move(make)), end_(std::move(end)) {}

void StreamAuthorization::Start() {
  MutexLock lock(state_->mutex);
  if (state_->stopped) return;
  state_->next = timer_->Start(std::chrono::steady_clock::now() + period_, [this] { Ask(); });
}

void StreamAuthorization::Ask() {
  Question question = make_();
  if (!question) {
    Start();
    return;
  }
  pool_->Post(Lane::kLeases, [this, state = state_, question = std::move(question)] {
    const absl::Status status = question();
    {
      MutexLock lock(state->mutex);
      if (state->stopped) return;  // `this` may be gone
      state->calling = true;
    }
    TakeAnswer(status);
    MutexLock lock(state->mutex);
    state->calling = false;
    state->answered.NotifyAll();
  });
}

void StreamAuthorization::TakeAnswer(const absl::Status& status) {
  if (status.ok()) {
    Start();
  } else {
    end_(status);
  }
}

void StreamAuthorization::Stop() {
  DeadlineTimer::Id next;
  {
    MutexLock lock(state_->mutex);
    state_->stopped = true;
    next = state_->next;
  }
  timer_->Cancel(next);
  MutexLock lock(state_->mutex);
  while (state_->calling) state_->answered.Wait(state_->mutex);
}

}  // namespace tissueform
