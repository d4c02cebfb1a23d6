// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>

namespace tissueform {

// Tells on stderr that a stage is at work when it takes longer than a second, and how long it took
// when it ends. Short stages say nothing.
class StageProgress {
 public:
  explicit StageProgress(std::string stage);
  ~StageProgress();
  StageProgress(const StageProgress&) = delete;
  StageProgress& operator=(const StageProgress&) = delete;

 private:
  void Watch(const std::stop_token& stop);

  const std::string stage_;
  std::mutex mutex_;  // for the wait only
  std::condition_variable_any ended_;
  std::jthread watcher_;  // last: it uses the others
};

}  // namespace tissueform
