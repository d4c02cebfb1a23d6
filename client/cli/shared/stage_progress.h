// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "core/base/stopwatch.h"

namespace tissueform {

// Tells on stderr that a stage is at work when it takes longer than a second, and how long it took
// when it ends. Short stages say nothing. One at a time.
//
// Uses the process's interval timer (SIGALRM), not a thread: reading a mesh forks, and a thread
// that holds a lock of the allocator at that moment would leave the child waiting for it for ever.
class StageProgress {
 public:
  explicit StageProgress(std::string stage);
  ~StageProgress();
  StageProgress(const StageProgress&) = delete;
  StageProgress& operator=(const StageProgress&) = delete;

 private:
  const std::string stage_;
  const Stopwatch stopwatch_;
};

}  // namespace tissueform
