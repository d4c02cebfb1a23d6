// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>

namespace tissueform {

// What time it is, for everything that outlives a call: idle sessions and meshes, later leases.
// Injected, so that tests turn it themselves. Thread-safe.
class Clock {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;
  using Duration = std::chrono::steady_clock::duration;

  virtual ~Clock() = default;
  // Never goes back.
  virtual TimePoint Now() const = 0;

  // The machine's. Lives as long as the process.
  static const Clock* System();
};

}  // namespace tissueform
