// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "absl/status/status.h"

#include "core/base/mutex.h"
#include "server/rpc/calls/call_observer.h"
#include "server/session/clock.h"
#include "server/session/quotas.h"

namespace tissueform {

// Counts every principal's calls against its quotas: how many a second, how many at once, and how
// many of those are streams. Forgets principals that have no call open and all tokens back.
//
// Thread-safe; never blocks.
class CallQuotas {
 public:
  explicit CallQuotas(const Quotas& quotas, const Clock* clock = Clock::System());

  // A call begins. Errors: ResourceExhausted; then it has taken no place.
  absl::Status Begin(const std::string& principal, CallKind kind);
  // One that Begin let in is over.
  void End(const std::string& principal, CallKind kind);

  int open_streams(const std::string& principal) const;
  // How many principals are remembered.
  int64_t num_principals() const;

 private:
  struct Account {
    double tokens = 0;  // calls that may begin now
    Clock::TimePoint filled_at;
    int waiting = 0;
    int streams = 0;
  };

  // With those that have come back since.
  double TokensAt(const Account& account, Clock::TimePoint now) const;
  void ForgetIdle(Clock::TimePoint now) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const Quotas quotas_;
  const double most_tokens_;
  const Clock* const clock_;

  mutable Mutex mutex_;
  std::map<std::string, Account> accounts_ ABSL_GUARDED_BY(mutex_);
  Clock::TimePoint swept_at_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
