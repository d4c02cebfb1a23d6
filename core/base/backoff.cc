// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/backoff.h"

#include <algorithm>

#include "core/base/error_reason.h"

namespace tissueform {

std::chrono::milliseconds Backoff::After(const absl::Status& error) {
  const bool is_moving =
      HasReason(error, ErrorReason::kSessionMoved) || HasReason(error, ErrorReason::kWrongNode);
  return NextUpTo(is_moving ? std::min(kLongestMovingWait, options_.most) : options_.most);
}

// What follows on a move does not wait long because the move took long.
std::chrono::milliseconds Backoff::NextUpTo(std::chrono::milliseconds most) {
  using Milliseconds = std::chrono::duration<double, std::milli>;
  std::uniform_real_distribution<double> part(1 - options_.spread, 1 + options_.spread);
  const Milliseconds wait = std::min<Milliseconds>(wait_, most) * part(random_);
  if (wait_ < most) wait_ = std::min<Milliseconds>(wait_ * options_.factor, options_.most);
  return std::chrono::duration_cast<std::chrono::milliseconds>(wait);
}

bool IsTransient(const absl::Status& status) {
  return absl::IsUnavailable(status) || absl::IsUnknown(status) || absl::IsInternal(status) ||
         absl::IsResourceExhausted(status);
}

}  // namespace tissueform
