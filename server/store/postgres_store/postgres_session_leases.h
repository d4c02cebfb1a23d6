// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <map>
#include <string>
#include <vector>

#include "core/base/mutex.h"
#include "server/store/postgres_store/postgres_pool.h"
#include "server/store/postgres_store/session_leases.h"

namespace tissueform {

// Leases as columns beside a session's epoch, on the clock tissueform_now() of the database. Each
// call is one statement, which the database decides alone.
//
// A lease that ends later than leases do is from before that clock was set back. A live holder
// renews it, but a dead one would keep its sessions for as long as the clock was set back: so it
// is over when this has seen it unchanged for a lease's time.
class PostgresSessionLeases final : public SessionLeases {
 public:
  // `node`: where clients find this server. Two servers of one name are still two holders:
  // each makes a random one. `pool` must outlive it.
  PostgresSessionLeases(PostgresPool* pool, std::string node, LeaseOptions options = {},
                        SteadyNow clock = AwakeOrNotNow);

  absl::StatusOr<LeaseAnswer> Acquire(const std::string& session) override;
  absl::StatusOr<std::vector<SessionLease>> Renew() override;
  absl::Status Release(const std::string& session, int64_t epoch) override;

  const std::string& holder() const { return holder_; }

 private:
  SessionLease LeaseFrom(std::chrono::steady_clock::time_point asked, std::string session,
                         int64_t epoch) const;
  absl::Status Run(const PostgresPool::Work& work);
  // The end of a lease that has been seen for so long; empty: none.
  std::string SeenTooLong(const std::string& session) ABSL_LOCKS_EXCLUDED(mutex_);
  void NoteSeen(const std::string& session, const std::string& too_late)
      ABSL_LOCKS_EXCLUDED(mutex_);

  PostgresPool* const pool_;
  const std::string node_;
  const std::string holder_;
  const LeaseOptions options_;
  const SteadyNow clock_;

  struct Seen {
    std::string lease_until = {};  // as the database writes it
    std::chrono::steady_clock::time_point since = {};
  };
  Mutex mutex_;
  std::map<std::string, Seen> seen_ ABSL_GUARDED_BY(mutex_);  // that end too late, by session
};

}  // namespace tissueform
