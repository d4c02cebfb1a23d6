// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/postgres_store/postgres_export_store.h"

#include <utility>

#include "core/base/status_macros.h"
#include "server/postgres_store/postgres_pages.h"
#include "server/store/store_records.h"

namespace tissueform {

absl::StatusOr<std::vector<ExportRecord>> PostgresExportStore::Load() {
  return AskPool<std::vector<ExportRecord>>(
      pool_, [](PostgresTransaction& transaction) -> absl::StatusOr<std::vector<ExportRecord>> {
        TF_ASSIGN_OR_RETURN(
            const PostgresRows rows,
            transaction.Query("SELECT name, record FROM exports ORDER BY name", {}));
        std::vector<ExportRecord> records;
        for (size_t row = 0; row < rows.size(); ++row) {
          const absl::StatusOr<absl::string_view> bytes = Unseal(rows.Text(row, 1));
          if (!bytes.ok()) continue;
          absl::StatusOr<ExportRecord> record = ParseExport(*bytes);
          if (record.ok() && record->id == rows.Text(row, 0)) {
            records.push_back(*std::move(record));
          }
        }
        return records;
      });
}

absl::Status PostgresExportStore::Put(const ExportRecord& record) {
  const std::string bytes = Seal(SerializeExport(record));
  return pool_->Run([&](PostgresTransaction& transaction) {
    return transaction.Run(
        "INSERT INTO exports (name, record) VALUES ($1, $2) ON CONFLICT (name) DO UPDATE SET "
        "record "
        "= excluded.record",
        {record.id, bytes});
  });
}

absl::Status PostgresExportStore::Erase(const std::vector<std::string>& ids) {
  const std::string names = PostgresNames(ids);
  return pool_->Run([&](PostgresTransaction& transaction) {
    return transaction.Run("DELETE FROM exports WHERE name = ANY (string_to_array($1, chr(31)))",
                           {names});
  });
}

}  // namespace tissueform
