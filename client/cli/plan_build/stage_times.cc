// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/plan_build/stage_times.h"

#include <cstdio>

#include "absl/strings/str_format.h"

namespace tissueform {

void StageTimes::Begin(absl::string_view stage, double fraction) {
  End();
  begun_seconds_ = whole_.Seconds();
  running_ = true;
  stages_.push_back({std::string(stage), 0});
  absl::FPrintF(stderr, "[%3.0f %% %6.1f s] %s\n", 100 * fraction, begun_seconds_, stage);
}

void StageTimes::End() {
  if (!running_) return;
  stages_.back().seconds = whole_.Seconds() - begun_seconds_;
  running_ = false;
}

}  // namespace tissueform
