// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <string>

#include "server/store/access_store/access_store.h"
#include "server/store/postgres_store/ordered_jobs.h"
#include "server/store/postgres_store/postgres_pool.h"

namespace tissueform {

// Rows of access in a PostgreSQL database; changes are made in the order of the calls. `pool` must
// outlive it.
class PostgresAccessStore final : public AccessStore {
 public:
  explicit PostgresAccessStore(PostgresPool* pool) : pool_(pool) {}

  absl::StatusOr<AccessRows> Load() override;
  void Change(AccessRows erase, AccessRows put, std::function<void(absl::Status)> done) override;

  // One row. Errors: NotFound, DataLoss.
  absl::StatusOr<FollowLinkRow> FindLink(const std::string& digest);
  absl::StatusOr<MeshRight> FindMeshRight(const std::string& principal, const std::string& sha256);

 private:
  PostgresPool* const pool_;
  OrderedJobs jobs_{1};  // last: its jobs use the pool
};

}  // namespace tissueform
