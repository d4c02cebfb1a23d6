// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"

#include "server/store/access_store/access_store.h"
#include "server/store/postgres_store/postgres_case_store.h"
#include "server/store/postgres_store/postgres_clock.h"
#include "server/store/postgres_store/postgres_mesh_store.h"
#include "server/store/postgres_store/postgres_pool.h"
#include "server/store/postgres_store/postgres_prediction_store.h"
#include "server/store/postgres_store/postgres_session_store.h"
#include "server/store/stores.h"

namespace tissueform {

struct PostgresStoresOptions {
  PostgresOptions database = {};
  UnixClock clock = nullptr;  // null: the database's
  // Of meshes that have not arrived in full: they are this server's own, in a temporary folder that
  // goes with it. A client whose server is gone sends such a mesh anew.
  UploadLimits uploads = {};
};

// All that servers keep together, in one PostgreSQL database.
class PostgresStores final : public Stores {
 public:
  // Opens the store, or makes its tables. Errors: those of PostgresPool::Open and
  // PreparePostgresSchema, or what the disk says.
  static absl::StatusOr<std::unique_ptr<PostgresStores>> Open(const PostgresStoresOptions& options);

  SessionStore& sessions() override { return sessions_; }
  MeshStore& meshes() override { return meshes_; }
  UploadStore& uploads() override { return *uploads_; }
  PredictionStore& predictions() override { return predictions_; }
  CaseStore& cases() override { return cases_; }
  const DurationHistogram* latency() const override { return &pool_->latency(); }
  bool keeps() const override { return true; }
  int64_t NowS() const override { return clock_(); }
  absl::Status AskTime() override { return database_clock_.Ask(); }

  PostgresPool* pool() { return pool_.get(); }

 private:
  PostgresStores(const PostgresStoresOptions& options, std::unique_ptr<PostgresPool> pool,
                 std::unique_ptr<UploadStore> uploads)
      : pool_(std::move(pool)),
        uploads_(std::move(uploads)),
        database_clock_(pool_.get()),
        clock_(options.clock ? options.clock : [this] { return database_clock_.NowS(); }),
        sessions_(pool_.get(), clock_),
        meshes_(pool_.get()),
        predictions_(pool_.get()),
        cases_(pool_.get()) {}

  const std::unique_ptr<PostgresPool> pool_;
  const std::unique_ptr<UploadStore> uploads_;
  PostgresClock database_clock_;
  const UnixClock clock_;
  PostgresSessionStore sessions_;
  PostgresMeshStore meshes_;
  PostgresPredictionStore predictions_;
  PostgresCaseStore cases_;
};

}  // namespace tissueform
