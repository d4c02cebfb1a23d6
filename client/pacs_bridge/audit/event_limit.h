// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>

namespace tissueform {

// Limits events that anyone on the network can cause: of each source some in a period, and so many
// sources. Counts what it drops. A period begins with the first event after the last period.
//
// Not thread-safe. Memory is bounded by `max_sources`.
class EventLimit {
 public:
  using Time = std::chrono::steady_clock::time_point;
  struct Options {
    int max_per_source = 5;
    size_t max_sources = 1024;
    std::chrono::milliseconds period{60'000};
  };

  explicit EventLimit(const Options& options) : options_(options) {}

  // Whether the event is within the limit; otherwise it is counted.
  bool Admit(const std::string& source, Time now);

  // Since the last TakeDropped.
  int64_t dropped() const { return dropped_; }
  int64_t TakeDropped();
  // When the period ends that the last event belongs to.
  Time period_end() const { return period_end_; }

 private:
  const Options options_;
  Time period_end_ = {};
  std::map<std::string, int> counts_;
  int64_t dropped_ = 0;
};

}  // namespace tissueform
