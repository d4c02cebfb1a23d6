// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <map>
#include <string>

#include "absl/status/status.h"

#include "core/base/backoff.h"

namespace tissueform {

// Whether another attempt at a step of an export may succeed though nothing is changed here: the
// PACS may come back, there may be room again, or the bridge is ending.
bool MayCome(const absl::Status& status);

// When a step that failed is tried again, by the key of whose step it is: after a second, then
// longer each time, up to a minute. By the monotonic clock, which cannot be set; after a restart
// everything is tried at once. One thread at a time.
class RetryTimes {
 public:
  using Clock = std::chrono::steady_clock;

  bool Due(const std::string& key) const {
    const auto found = waits_.find(key);
    return found == waits_.end() || Clock::now() >= found->second.next;
  }
  void Failed(const std::string& key) {
    Wait& wait = waits_.try_emplace(key).first->second;
    wait.next = Clock::now() + wait.backoff.Next();
  }
  void Succeeded(const std::string& key) { waits_.erase(key); }

 private:
  struct Wait {
    Backoff backoff{{.first = std::chrono::seconds(1),
                     .most = std::chrono::minutes(1),
                     .factor = 2,
                     .spread = 0.2}};
    Clock::time_point next = {};
  };

  std::map<std::string, Wait> waits_;
};

}  // namespace tissueform
