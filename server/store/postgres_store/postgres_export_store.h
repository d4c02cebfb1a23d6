// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "server/exports/export_store.h"
#include "server/store/postgres_store/postgres_pool.h"

namespace tissueform {

// Exports in a PostgreSQL database, which several servers change: each version follows the one
// before. `pool` must outlive it.
class PostgresExportStore final : public ExportStore {
 public:
  explicit PostgresExportStore(PostgresPool* pool) : pool_(pool) {}

  absl::StatusOr<std::vector<ExportRecord>> Load() override;
  absl::Status Put(const ExportRecord& record) override;
  // Of whatever version, into a store that has none of them.
  absl::Status PutAll(const std::vector<ExportRecord>& records);
  absl::Status Erase(const std::vector<std::string>& ids) override;

 private:
  PostgresPool* const pool_;
};

}  // namespace tissueform
