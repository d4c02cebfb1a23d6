// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "server/postgres_store/session_leases.h"

namespace tissueform {

// Leases whose calls are counted, by what became of them, and that tell when they cannot be renewed
// any longer: no session can be held here then, and can elsewhere, perhaps.
//
// Thread-safe.
class CountedLeases final : public SessionLeases {
 public:
  // `leases` must outlive it; `lasting` is how long they may be answered after a renewal.
  CountedLeases(SessionLeases* leases, std::chrono::milliseconds lasting)
      : leases_(*leases), lasting_(lasting) {}

  // Told true or false when that changes, on the thread that renews. Before the first renewal.
  void set_on_renewable(std::function<void(bool)> told) { on_renewable_ = std::move(told); }

  absl::StatusOr<LeaseAnswer> Acquire(const std::string& session) override;
  absl::StatusOr<std::vector<SessionLease>> Renew() override;
  absl::Status Release(const std::string& session, int64_t epoch) override;

  struct Counts {
    std::atomic<int64_t> taken = 0;    // or held already
    std::atomic<int64_t> refused = 0;  // another holds it
    std::atomic<int64_t> renewed = 0;
    std::atomic<int64_t> released = 0;
    // The database did not answer, or refused.
    std::atomic<int64_t> takings_failed = 0;
    std::atomic<int64_t> renewals_failed = 0;
    std::atomic<int64_t> releases_failed = 0;
  };
  const Counts& counts() const { return counts_; }
  // Since the last renewal that succeeded, or since this was made.
  std::chrono::duration<double> SinceRenewal() const;

 private:
  SessionLeases& leases_;
  const std::chrono::milliseconds lasting_;
  std::function<void(bool)> on_renewable_ = [](bool /*renewable*/) {};
  Counts counts_;
  bool renewable_ = true;  // of the thread that renews
  std::atomic<std::chrono::steady_clock::time_point> renewed_ = std::chrono::steady_clock::now();
};

}  // namespace tissueform
