// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/postgres_database.h"

#include <algorithm>
#include <chrono>
#include <utility>

namespace tissueform {
namespace {

constexpr std::chrono::milliseconds kBrief{2'000};

PostgresPool::Idempotent IsIdempotent(const SqlJob& job) {
  return job.repeatable ? PostgresPool::Idempotent::kYes : PostgresPool::Idempotent::kNo;
}

}  // namespace

// Half of the connections for each, so that blob transfers also get some.
PostgresDatabase::PostgresDatabase(PostgresPool* pool)
    : pool_(pool),
      jobs_((pool->options().max_connections + 1) / 2),
      peeks_((pool->options().max_connections + 1) / 2) {}

PostgresPool::Clock::time_point PostgresDatabase::BriefDeadline() const {
  return PostgresPool::Clock::now() + std::min(pool_->options().patience, kBrief);
}

absl::Status PostgresDatabase::Run(const SqlJob& job) {
  if (job.brief) return pool_->Run(job.work, BriefDeadline(), IsIdempotent(job));
  return pool_->Run(job.work, IsIdempotent(job));
}

void PostgresDatabase::Submit(const std::string& key, SqlJob job, StatusCallback done) {
  const auto deadline = PostgresPool::Clock::now() + pool_->options().patience;
  jobs_.Submit(key, [this, deadline, job = std::move(job), done = std::move(done)] {
    done(pool_->Run(job.work, deadline, IsIdempotent(job)));
  });
}

void PostgresDatabase::Peek(const std::string& key, SqlJob job, StatusCallback done) {
  const auto deadline = BriefDeadline();
  peeks_.Submit(key, [this, deadline, job = std::move(job), done = std::move(done)] {
    done(pool_->Run(job.work, deadline, IsIdempotent(job)));
  });
}

}  // namespace tissueform
