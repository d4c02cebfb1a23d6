// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "core/base/mutex.h"

namespace tissueform {

// Threads that do one kind of work each, step after step with a rest between, and who among them
// hangs.
class WorkThreads {
 public:
  using Clock = std::chrono::steady_clock;

  struct Work {
    std::string name = {};               // of this thread alone
    std::chrono::milliseconds pause{0};  // its rest, which Wake ends
    std::chrono::seconds most_time{0};   // more than a step takes whose peers keep their own times
  };

  // `now`: by which Stuck measures; any thread.
  explicit WorkThreads(std::function<Clock::time_point()> now) : now_(std::move(now)) {}
  ~WorkThreads() { End(); }
  WorkThreads(const WorkThreads&) = delete;
  WorkThreads& operator=(const WorkThreads&) = delete;

  // A thread that calls `step` from now until the end. Where Start and End are called, no thread of
  // these.
  void Start(const Work& work, std::function<void()> step) ABSL_LOCKS_EXCLUDED(mutex_);
  // Waits for the steps that are under way, and begins none. Nothing when it was called before.
  void End() ABSL_LOCKS_EXCLUDED(mutex_);

  // The others: any thread.
  bool stopping() ABSL_LOCKS_EXCLUDED(mutex_);
  // Ends every rest: there is something new.
  void Wake() ABSL_LOCKS_EXCLUDED(mutex_);
  // Within a long step: another part of it begins, which may take as long again.
  void BeginStep(const std::string& name) ABSL_LOCKS_EXCLUDED(mutex_);
  // Names of those that have been at one step for longer than any takes, or have not come back from
  // their rest.
  std::vector<std::string> Stuck() ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  struct Limit {
    std::chrono::seconds most_time{0};
    Clock::time_point latest = {};  // when the thread must have come on
  };

  void Loop(const Work& work, const std::function<void()>& step) ABSL_LOCKS_EXCLUDED(mutex_);

  const std::function<Clock::time_point()> now_;

  Mutex mutex_;
  ConditionVariable changed_;
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
  int64_t wakes_ ABSL_GUARDED_BY(mutex_) = 0;
  std::map<std::string, Limit> limits_ ABSL_GUARDED_BY(mutex_);

  std::vector<std::thread> threads_;
};

}  // namespace tissueform
