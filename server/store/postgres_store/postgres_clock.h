// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <cstdint>

#include "absl/status/status.h"

#include "server/store/postgres_store/postgres_pool.h"

namespace tissueform {

// The database's time, on which servers agree regardless of their machines' clocks: as it was asked
// last, and as it went on since by a clock that never goes back.
//
// Thread-safe.
class PostgresClock {
 public:
  // `pool` must outlive it. REQUIRES: Ask before NowS.
  explicit PostgresClock(PostgresPool* pool) : pool_(pool) {}

  // Blocks. Errors: those of the pool; then what it was asked last counts.
  absl::Status Ask();
  // Unix seconds. Fast.
  int64_t NowS() const;

 private:
  PostgresPool* const pool_;
  std::atomic<int64_t> ahead_ms_ = 0;  // of the clock that never goes back
};

}  // namespace tissueform
