// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"

#include "server/store/ordered_jobs.h"
#include "server/store/postgres_store/postgres_pool.h"
#include "server/store/sql_database.h"

namespace tissueform {

// The driver for PostgreSQL, which several servers share. A call ends within
// PostgresOptions::patience, with Unavailable if the database cannot be reached. Submit and Peek
// call `done` on threads of this object.
class PostgresDatabase final : public SqlDatabase {
 public:
  // `pool` must outlive it.
  explicit PostgresDatabase(PostgresPool* pool);

  absl::Status Run(const SqlJob& job) override;
  void Submit(const std::string& key, SqlJob job, StatusCallback done) override;
  void Peek(const std::string& key, SqlJob job, StatusCallback done) override;
  bool shared() const override { return true; }
  const DurationHistogram* latency() const override { return &pool_->latency(); }

 private:
  PostgresPool::Clock::time_point BriefDeadline() const;

  PostgresPool* const pool_;
  // Last: their jobs use the others.
  OrderedJobs jobs_;
  OrderedJobs peeks_;
};

}  // namespace tissueform
