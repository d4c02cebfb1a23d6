// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/shared/stage_progress.h"

#include <chrono>
#include <cstdio>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace tissueform {
namespace {

constexpr std::chrono::seconds kShort{1};
constexpr double kSecondsBetweenLines = 1;

}  // namespace

StageProgress::StageProgress(std::string stage)
    : stage_(std::move(stage)),
      announced_(std::async(std::launch::async, [this, end = ended_.get_future()] {
        return AnnounceUnlessShort(end);
      })) {}

StageProgress::~StageProgress() {
  ended_.set_value();
  if (announced_.get()) absl::FPrintF(stderr, "%s: %.1f s\n", stage_, stopwatch_.Seconds());
}

bool StageProgress::AnnounceUnlessShort(const std::future<void>& end) {
  if (end.wait_for(kShort) == std::future_status::ready) return false;
  MutexLock lock(mutex_);
  Print();
  return true;
}

void StageProgress::Report(std::string news) {
  MutexLock lock(mutex_);
  news_ = std::move(news);
  if (printed_at_seconds_ >= 0 &&
      stopwatch_.Seconds() - printed_at_seconds_ >= kSecondsBetweenLines) {
    Print();
  }
}

void StageProgress::Print() {
  printed_at_seconds_ = stopwatch_.Seconds();
  absl::FPrintF(stderr, "%s%s ...\n", stage_, news_.empty() ? "" : absl::StrCat(": ", news_));
}

}  // namespace tissueform
