// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <thread>

#include "absl/status/status.h"

#include "client/cpp/mesh_upload.h"
#include "core/base/backoff.h"

namespace tissueform {

// Attempts of an upload that continues where an earlier one broke off. `try_once(again)` returns a
// StatusOr; `may_repeat(status)` says whether another attempt may succeed; `farthest` is the
// farthest byte that an attempt has reached, which try_once raises. Ends with the last error when
// no attempt has come farther for options.give_up_after.
template <typename TryOnce, typename MayRepeat>
auto RunUploadAttempts(const UploadOptions& options, const int64_t& farthest,
                       const TryOnce& try_once, const MayRepeat& may_repeat)
    -> decltype(try_once(false)) {
  using Clock = std::chrono::steady_clock;
  Clock::time_point give_up = Clock::now() + options.give_up_after;
  Backoff backoff(options.backoff);
  for (bool again = false;; again = true) {
    const int64_t farthest_before = farthest;
    auto uploaded = try_once(again);
    if (uploaded.ok() || !may_repeat(uploaded.status())) return uploaded;
    if (options.on_interrupted) options.on_interrupted(uploaded.status());
    // The time counts from the end of an attempt that was of use: one may last for minutes.
    if (farthest > farthest_before) give_up = Clock::now() + options.give_up_after;
    const std::chrono::milliseconds wait = backoff.Next();
    if (Clock::now() + wait > give_up) return uploaded;
    std::this_thread::sleep_for(wait);
  }
}

}  // namespace tissueform
