// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/work/work_threads.h"

#include <utility>

namespace tissueform {

void WorkThreads::Start(const Work& work, std::function<void()> step) {
  {
    MutexLock lock(mutex_);
    limits_[work.name].most_time = work.most_time;
  }
  BeginStep(work.name);
  threads_.emplace_back([this, work, step = std::move(step)] { Loop(work, step); });
}

void WorkThreads::End() {
  {
    MutexLock lock(mutex_);
    stopping_ = true;
  }
  changed_.NotifyAll();
  for (std::thread& thread : threads_) thread.join();
  threads_.clear();
}

bool WorkThreads::stopping() {
  MutexLock lock(mutex_);
  return stopping_;
}

void WorkThreads::Wake() {
  {
    MutexLock lock(mutex_);
    ++wakes_;
  }
  changed_.NotifyAll();
}

void WorkThreads::BeginStep(const std::string& name) {
  MutexLock lock(mutex_);
  Limit& limit = limits_[name];
  limit.latest = now_() + limit.most_time;
}

std::vector<std::string> WorkThreads::Stuck() {
  std::vector<std::string> stuck;
  MutexLock lock(mutex_);
  for (const auto& [name, limit] : limits_) {
    if (now_() > limit.latest) stuck.push_back(name);
  }
  return stuck;
}

void WorkThreads::Loop(const Work& work, const std::function<void()>& step) {
  constexpr std::chrono::minutes kMaxLateness{1};  // back from its rest
  int64_t seen = 0;
  while (!stopping()) {
    BeginStep(work.name);
    {
      MutexLock lock(mutex_);
      seen = wakes_;
    }
    step();
    const Clock::time_point until = Clock::now() + work.pause;
    MutexLock lock(mutex_);
    limits_[work.name].latest = now_() + work.pause + kMaxLateness;
    while (!stopping_ && wakes_ == seen && changed_.WaitUntil(mutex_, until)) {
    }
  }
}

}  // namespace tissueform
