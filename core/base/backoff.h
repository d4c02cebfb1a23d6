// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <random>

#include "absl/status/status.h"

namespace tissueform {

inline constexpr std::chrono::milliseconds kLongestMovingWait{400};

// How long to wait before the next attempt: longer each time, and by chance somewhat more or less,
// so that clients of a server that comes back do not all ask at once. One thread at a time.
class Backoff {
 public:
  struct Options {
    std::chrono::milliseconds first{50};
    std::chrono::milliseconds most{2'000};
    double factor = 1.6;
    double spread = 0.2;  // part of the wait, both ways
  };

  explicit Backoff(const Options& options) : options_(options), wait_(options.first) {}

  std::chrono::milliseconds Next() { return NextUpTo(options_.most); }
  // The same after an error: where it says that the session is moving to another server, which it
  // has within seconds, no longer than kLongestMovingWait, since a hand waits for it.
  std::chrono::milliseconds After(const absl::Status& error);
  // As at the beginning.
  void Reset() { wait_ = options_.first; }

 private:
  std::chrono::milliseconds NextUpTo(std::chrono::milliseconds most);

  const Options options_;
  std::chrono::duration<double, std::milli> wait_;
  std::minstd_rand random_{std::random_device()()};
};

// Whether another attempt may succeed though nothing is changed: the server is away or just ending
// (UNAVAILABLE; proxies say UNKNOWN or INTERNAL of a server that dies), or has no room at the
// moment.
bool IsTransient(const absl::Status& status);

}  // namespace tissueform
