// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"

#include "server/store/postgres_store/postgres_blobs.h"
#include "server/store/postgres_store/postgres_clock.h"
#include "server/store/postgres_store/postgres_database.h"
#include "server/store/postgres_store/postgres_pool.h"
#include "server/store/sql_stores.h"

namespace tissueform {

struct PostgresStoresOptions {
  PostgresOptions database = {};
  UnixClock clock = nullptr;  // null: the database's
  // Of meshes that have not arrived in full: they are this server's own, in a temporary folder that
  // goes with it. A client whose server is gone sends such a mesh again.
  UploadLimits uploads = {};
};

// All that servers keep together, in one PostgreSQL database.
class PostgresStores final : public SqlStores {
 public:
  // Opens the store, or makes its tables. Errors: those of PostgresPool::Open and
  // PreparePostgresSchema, or what the disk says.
  static absl::StatusOr<std::unique_ptr<PostgresStores>> Open(const PostgresStoresOptions& options);

  bool keeps() const override { return true; }
  int64_t NowS() const override { return parts_->clock(); }
  absl::Status AskTime() override { return parts_->database_clock.Ask(); }

  PostgresPool* pool() { return parts_->pool.get(); }

 private:
  struct Parts {
    Parts(std::unique_ptr<PostgresPool> opened, const UnixClock& other_clock)
        : pool(std::move(opened)),
          database_clock(pool.get()),
          clock(other_clock ? other_clock : [this] { return database_clock.NowS(); }),
          blobs(pool.get()),
          database(pool.get()) {}

    const std::unique_ptr<PostgresPool> pool;
    PostgresClock database_clock;
    const UnixClock clock;
    PostgresBlobs blobs;
    PostgresDatabase database;  // last: its jobs use the others
  };

  PostgresStores(std::unique_ptr<Parts> parts, std::unique_ptr<UploadStore> uploads)
      : SqlStores(&parts->database, &parts->blobs, std::move(uploads), parts->clock),
        parts_(std::move(parts)) {}

  const std::unique_ptr<Parts> parts_;
};

}  // namespace tissueform
