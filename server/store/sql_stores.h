// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <utility>

#include "absl/status/statusor.h"

#include "server/store/sql_blobs.h"
#include "server/store/sql_case_store.h"
#include "server/store/sql_database.h"
#include "server/store/sql_mesh_store.h"
#include "server/store/sql_prediction_store.h"
#include "server/store/sql_session_store.h"
#include "server/store/stores.h"

namespace tissueform {

// The stores over a driver, which derived classes own.
class SqlStores : public Stores {
 public:
  SessionStore& sessions() override { return sessions_; }
  MeshStore& meshes() override { return meshes_; }
  UploadStore& uploads() override { return *uploads_; }
  PredictionStore& predictions() override { return predictions_; }
  CaseStore& cases() override { return cases_; }
  SqlDatabase& database() override { return database_; }
  SqlBlobs& blobs() { return blobs_; }
  const DurationHistogram* latency() const override { return database_.latency(); }

 protected:
  // `database` and `blobs` are not used by the constructor and destructor; they must outlive calls.
  SqlStores(SqlDatabase* database, SqlBlobs* blobs, std::unique_ptr<UploadStore> uploads,
            UnixClock clock)
      : database_(*database),
        blobs_(*blobs),
        uploads_(std::move(uploads)),
        sessions_(database, std::move(clock)),
        meshes_(database, blobs),
        predictions_(database, blobs),
        cases_(database, blobs) {}

 private:
  SqlDatabase& database_;
  SqlBlobs& blobs_;
  const std::unique_ptr<UploadStore> uploads_;
  SqlSessionStore sessions_;
  SqlMeshStore meshes_;
  SqlPredictionStore predictions_;
  SqlCaseStore cases_;
};

// For --in-memory: an SQLite database in memory and temporary folders for meshes, positions, cases
// and partial uploads, which are deleted with it.
// Errors: those of UploadStore::OpenTemporary.
absl::StatusOr<std::unique_ptr<Stores>> OpenInMemoryStores(UnixClock clock = SystemUnixSeconds,
                                                           UploadLimits limits = {});

}  // namespace tissueform
