// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <future>
#include <string>

#include "core/base/stopwatch.h"

namespace tissueform {

// Tells on stderr that a stage is at work when it takes longer than a second, and how long it took
// when it ends. Short stages say nothing. One at a time.
class StageProgress {
 public:
  explicit StageProgress(std::string stage);
  ~StageProgress();
  StageProgress(const StageProgress&) = delete;
  StageProgress& operator=(const StageProgress&) = delete;

 private:
  const std::string stage_;
  const Stopwatch stopwatch_;
  std::promise<void> ended_;
  std::future<bool> announced_;  // by a thread that waits for the end, or a second
};

}  // namespace tissueform
