// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/base/mutex.h"
#include "server/store/postgres_store/session_leases.h"

namespace tissueform {

// What one server knows of the leases that it holds.
//
// Thread-safe; never waits for the store.
class HeldLeases {
 public:
  // The epoch to write under; none when the session may not be answered at this time.
  std::optional<int64_t> EpochOf(const std::string& session,
                                 std::chrono::steady_clock::time_point now);
  std::vector<std::string> Sessions();

  // After an Acquire. Returns what is lost by it: the lease under another epoch, since another
  // server may have held the session in between.
  std::vector<SessionLease> Acquired(const std::string& session, const LeaseAnswer& answer);
  // Takes one out.
  std::optional<SessionLease> Take(const std::string& session);
  // Holds what was renewed, or is held as before; returns what is held no longer. Strays were
  // acquired by a call whose answer was lost, so this server does not know of them.
  std::vector<SessionLease> Renewed(const std::vector<SessionLease>& renewed,
                                    std::vector<SessionLease>* strays);
  // Takes out those that may no longer be answered.
  std::vector<SessionLease> TakeEnded(std::chrono::steady_clock::time_point now);

 private:
  Mutex mutex_;
  std::map<std::string, SessionLease> leases_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
