// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <future>
#include <string>

#include "core/base/mutex.h"
#include "core/base/stopwatch.h"

namespace tissueform {

// Reports on stderr that a stage is at work when it takes longer than a second, then at most once a
// second what it is at, and how long it took when it ends. Short stages say nothing. One at a time.
class StageProgress {
 public:
  explicit StageProgress(std::string stage);
  ~StageProgress();
  StageProgress(const StageProgress&) = delete;
  StageProgress& operator=(const StageProgress&) = delete;

  // What it is at. Any thread.
  void Report(std::string news) ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  bool AnnounceUnlessShort(const std::future<void>& end) ABSL_LOCKS_EXCLUDED(mutex_);
  void Print() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const std::string stage_;
  const Stopwatch stopwatch_;

  Mutex mutex_;
  std::string news_ ABSL_GUARDED_BY(mutex_);                // empty: no progress reported yet
  double printed_at_seconds_ ABSL_GUARDED_BY(mutex_) = -1;  // negative: not announced yet

  std::promise<void> ended_;
  std::future<bool> announced_;  // by a thread that waits for the end, or a second
};

}  // namespace tissueform
