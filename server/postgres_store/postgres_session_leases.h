// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "server/postgres_store/postgres_pool.h"
#include "server/postgres_store/session_leases.h"

namespace tissueform {

// Leases as columns beside a session's epoch, on the clock tissueform_now() of the database. Each
// call is one statement, which the database decides alone.
class PostgresSessionLeases final : public SessionLeases {
 public:
  // `node`: where clients find this server. Two servers of one name are two holders all the same:
  // each makes a random one. `pool` must outlive it.
  PostgresSessionLeases(PostgresPool* pool, std::string node, LeaseOptions options = {},
                        SteadyNow clock = std::chrono::steady_clock::now);

  absl::StatusOr<LeaseAnswer> Acquire(const std::string& session) override;
  absl::StatusOr<std::vector<SessionLease>> Renew() override;
  absl::Status Release(const std::string& session, int64_t epoch) override;

  const std::string& holder() const { return holder_; }

 private:
  SessionLease LeaseFrom(std::chrono::steady_clock::time_point asked, std::string session,
                         int64_t epoch) const;
  absl::Status Run(const PostgresPool::Work& work);

  PostgresPool* const pool_;
  const std::string node_;
  const std::string holder_;
  const LeaseOptions options_;
  const SteadyNow clock_;
};

}  // namespace tissueform
