// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "core/base/mutex.h"

namespace tissueform {

// Threads on which jobs of one key run one at a time, in the order in which they came.
class OrderedJobs {
 public:
  using Job = std::function<void()>;

  explicit OrderedJobs(int threads);
  // Runs all that was submitted.
  ~OrderedJobs();

  // Any thread.
  void Submit(const std::string& key, Job job);

 private:
  struct Line {
    Mutex mutex;
    ConditionVariable changed;
    std::deque<Job> waiting ABSL_GUARDED_BY(mutex);
    bool ending ABSL_GUARDED_BY(mutex) = false;
    std::thread thread;
  };

  static void Loop(Line* line);

  std::vector<std::unique_ptr<Line>> lines_;
};

}  // namespace tissueform
