// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/stage_progress.h"

#include <chrono>
#include <cstdio>
#include <utility>

#include "absl/strings/str_format.h"

#include "core/base/stopwatch.h"

namespace tissueform {

StageProgress::StageProgress(std::string stage)
    : stage_(std::move(stage)), watcher_([this](const std::stop_token& stop) { Watch(stop); }) {}

StageProgress::~StageProgress() {
  watcher_.request_stop();
  watcher_.join();
}

void StageProgress::Watch(const std::stop_token& stop) {
  const Stopwatch stopwatch;
  const auto never = [] { return false; };
  std::unique_lock lock(mutex_);
  ended_.wait_for(lock, stop, std::chrono::seconds(1), never);
  if (stop.stop_requested()) return;
  absl::FPrintF(stderr, "%s ...\n", stage_);
  ended_.wait(lock, stop, never);
  absl::FPrintF(stderr, "%s: %.1f s\n", stage_, stopwatch.Seconds());
}

}  // namespace tissueform
