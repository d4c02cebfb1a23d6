// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/deadline_timer.h"

namespace tissueform {

DeadlineTimer::DeadlineTimer() : thread_([this] { Wait(); }) {}

DeadlineTimer::~DeadlineTimer() {
  {
    MutexLock lock(mutex_);
    stopping_ = true;
    changed_.NotifyAll();
  }
  thread_.join();
}

DeadlineTimer::Id DeadlineTimer::Start(TimePoint deadline, Expired expired) {
  MutexLock lock(mutex_);
  const Id id(deadline, ++last_);
  waiting_.emplace(id, std::move(expired));
  changed_.NotifyAll();
  return id;
}

void DeadlineTimer::Cancel(Id id) {
  if (id == Id()) return;  // it would be that of no function running, and waited for
  MutexLock lock(mutex_);
  waiting_.erase(id);
  while (running_ == id) changed_.Wait(mutex_);
}

void DeadlineTimer::Wait() {
  MutexLock lock(mutex_);
  while (!stopping_) {
    if (waiting_.empty()) {
      changed_.Wait(mutex_);
      continue;
    }
    const auto first = waiting_.begin();
    if (first->first.first > std::chrono::steady_clock::now()) {
      changed_.WaitUntil(mutex_, first->first.first);
      continue;
    }
    running_ = first->first;
    const Expired expired = std::move(first->second);
    waiting_.erase(first);
    mutex_.Unlock();
    expired();
    mutex_.Lock();
    running_ = Id();
    changed_.NotifyAll();
  }
}

}  // namespace tissueform
