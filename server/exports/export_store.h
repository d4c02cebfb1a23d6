// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/exports/export_record.h"
#include "server/store/sql_database.h"

namespace tissueform {

// Where exports are kept. tests/server/exports holds the contract.
//
// Calls block, not on the commit thread; durable when answered; thread-safe: as PredictionStore.
class ExportStore {
 public:
  virtual ~ExportStore() = default;

  // All, by id, rising. Damaged ones are passed over. Errors: what the disk says.
  virtual absl::StatusOr<std::vector<ExportRecord>> Load() = 0;

  // In place of the one with its id. Errors: Aborted (STALE_ETAG: the one that is kept is not of
  // the version before: another server has changed it), ResourceExhausted (the disk is full), or
  // what the disk says.
  virtual absl::Status Put(const ExportRecord& record) = 0;

  // All or nothing; missing ids are ignored. Errors: what the disk says.
  virtual absl::Status Erase(const std::vector<std::string>& ids) = 0;
};

// Sealed rows (store_schema.h).
class SqlExportStore final : public ExportStore {
 public:
  // `database` must outlive it.
  explicit SqlExportStore(SqlDatabase* database) : database_(database) {}

  absl::StatusOr<std::vector<ExportRecord>> Load() override;
  absl::Status Put(const ExportRecord& record) override;
  absl::Status Erase(const std::vector<std::string>& ids) override;

 private:
  SqlDatabase* const database_;
};

}  // namespace tissueform
