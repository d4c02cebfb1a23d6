// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "server/store/postgres_store/session_leases.h"

namespace tissueform {

// Leases whose calls are counted, by what became of them.
//
// Thread-safe.
class CountedLeases final : public SessionLeases {
 public:
  // `leases` must outlive it.
  explicit CountedLeases(SessionLeases* leases) : leases_(*leases) {}

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
  Counts counts_;
  std::atomic<std::chrono::steady_clock::time_point> renewed_ = std::chrono::steady_clock::now();
};

}  // namespace tissueform
