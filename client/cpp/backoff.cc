// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/backoff.h"

#include <algorithm>

namespace tissueform {

std::chrono::milliseconds Backoff::Next() {
  std::uniform_real_distribution<double> part(1 - options_.spread, 1 + options_.spread);
  const auto wait = std::chrono::duration_cast<std::chrono::milliseconds>(wait_ * part(random_));
  wait_ =
      std::min<std::chrono::duration<double, std::milli>>(wait_ * options_.factor, options_.most);
  return wait;
}

bool IsTransient(const absl::Status& status) {
  return absl::IsUnavailable(status) || absl::IsUnknown(status) || absl::IsInternal(status) ||
         absl::IsResourceExhausted(status);
}

}  // namespace tissueform
