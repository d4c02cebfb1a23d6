// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/shared/stage_progress.h"

#include <chrono>
#include <cstdio>
#include <utility>

#include "absl/strings/str_format.h"

namespace tissueform {
namespace {

constexpr std::chrono::seconds kShort{1};

bool AnnounceUnlessShort(const std::string& stage, const std::future<void>& end) {
  if (end.wait_for(kShort) == std::future_status::ready) return false;
  absl::FPrintF(stderr, "%s ...\n", stage);
  return true;
}

}  // namespace

StageProgress::StageProgress(std::string stage)
    : stage_(std::move(stage)),
      announced_(std::async(std::launch::async, [this, end = ended_.get_future()] {
        return AnnounceUnlessShort(stage_, end);
      })) {}

StageProgress::~StageProgress() {
  ended_.set_value();
  if (announced_.get()) absl::FPrintF(stderr, "%s: %.1f s\n", stage_, stopwatch_.Seconds());
}

}  // namespace tissueform
