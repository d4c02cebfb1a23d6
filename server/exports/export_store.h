// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/exports/export_record.h"
#include "server/store/stores.h"

namespace tissueform {

// Where exports are kept. tests/server/exports holds the contract.
//
// Calls block, not on the commit thread; durable when answered; thread-safe: as PredictionStore.
class ExportStore {
 public:
  virtual ~ExportStore() = default;

  // All, by id, rising. Damaged ones are passed over. Errors: what the disk says.
  virtual absl::StatusOr<std::vector<ExportRecord>> Load() = 0;

  // In place of the one with its id. Errors: Aborted (STALE_ETAG: where several servers write, the
  // one that is kept is not of the version before), ResourceExhausted (the disk is full), or what
  // the disk says.
  virtual absl::Status Put(const ExportRecord& record) = 0;

  // All or none; one that is not there is none. Errors: what the disk says.
  virtual absl::Status Erase(const std::vector<std::string>& ids) = 0;
};

// Beside the other rows of `stores`, which must outlive it; in memory where those are. REQUIRES:
// stores that keep have a commit thread (those of PostgreSQL have a PostgresExportStore).
std::unique_ptr<ExportStore> OpenExportStore(Stores* stores);

}  // namespace tissueform
