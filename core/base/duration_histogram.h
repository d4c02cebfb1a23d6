// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>

namespace tissueform {

// How long operations took, counted in buckets, for monitoring. Thread-safe, without a lock;
// Observe takes some nanoseconds.
class DurationHistogram {
 public:
  // Upper bounds of the buckets in seconds, each inclusive; what is longer is in one more.
  static constexpr std::array<double, 18> kBounds = {1e-4, 2.5e-4, 5e-4, 1e-3, 2.5e-3, 5e-3,
                                                     0.01, 0.025,  0.05, 0.1,  0.25,   0.5,
                                                     1.0,  2.5,    5.0,  10.0, 30.0,   100.0};

  struct Snapshot {
    std::array<uint64_t, kBounds.size() + 1> counts = {};  // of each bucket by itself
    double sum_seconds = 0;
  };

  // A negative duration counts as none.
  void Observe(std::chrono::steady_clock::duration duration);

  // Observations under way may be in the counts and not in the sum yet.
  Snapshot Read() const;

 private:
  std::array<std::atomic<uint64_t>, kBounds.size() + 1> counts_ = {};
  std::atomic<int64_t> sum_ns_ = 0;
};

}  // namespace tissueform
