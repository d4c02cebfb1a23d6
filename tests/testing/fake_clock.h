// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>

#include "server/session/clock.h"

namespace tissueform::testing {

// Stands still until a test turns it. Thread-safe.
class FakeClock final : public Clock {
 public:
  TimePoint Now() const override { return now_; }
  void Advance(TimePoint::duration duration) { now_ = now_.load() + duration; }

 private:
  // Far from zero, so that subtracting a TTL stays in range.
  std::atomic<TimePoint> now_ = TimePoint(std::chrono::hours(24 * 365));
};

}  // namespace tissueform::testing
