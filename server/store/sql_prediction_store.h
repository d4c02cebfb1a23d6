// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/store/prediction_store.h"
#include "server/store/sql_blobs.h"
#include "server/store/sql_database.h"
#include "server/store/store_records.h"

namespace tissueform {

// Rows that claim blobs: the blob is the positions.
class SqlPredictionStore final : public PredictionStore {
 public:
  // Both must outlive it.
  SqlPredictionStore(SqlDatabase* database, SqlBlobs* blobs) : database_(database), blobs_(blobs) {}

  absl::Status Create(const PredictionRecord& record, const std::string& positions) override;
  absl::StatusOr<PredictionRecord> Get(const std::string& id) override;
  absl::StatusOr<std::string> Positions(const std::string& id) override;
  absl::StatusOr<Page> List(const ListRequest& request) override;
  absl::Status Delete(const std::string& id) override;

 private:
  SqlDatabase* const database_;
  SqlBlobs* const blobs_;
};

BlobClaim ClaimOf(const PredictionRow& row);

}  // namespace tissueform
