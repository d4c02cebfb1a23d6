// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/postgres_export_store.h"

#include <utility>

#include "core/base/status_macros.h"
#include "server/store/postgres_store/postgres_pages.h"
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
  return pool_->Run([&](PostgresTransaction& transaction) -> absl::Status {
    // What is kept in these very words already was kept by a commit whose answer was lost.
    TF_ASSIGN_OR_RETURN(
        const PostgresRows rows,
        record.version <= 1
            ? transaction.Query(
                  "INSERT INTO exports (name, record, version) VALUES ($1, $2, $3) ON CONFLICT "
                  "(name) DO UPDATE SET record = excluded.record WHERE exports.record = "
                  "excluded.record RETURNING 1",
                  {record.id, bytes, record.version})
            : transaction.Query("UPDATE exports SET record = $2, version = $3 WHERE name = $1 AND "
                                "(version = $3::bigint - 1 OR record = $2) RETURNING 1",
                                {record.id, bytes, record.version}));
    return rows.empty() ? StaleExport(record.id) : absl::OkStatus();
  });
}

absl::Status PostgresExportStore::PutAll(const std::vector<ExportRecord>& records) {
  return pool_->Run([&](PostgresTransaction& transaction) -> absl::Status {
    for (const ExportRecord& record : records) {
      TF_RETURN_IF_ERROR(
          transaction.Run("INSERT INTO exports (name, record, version) VALUES ($1, $2, $3)",
                          {record.id, Seal(SerializeExport(record)), record.version}));
    }
    return absl::OkStatus();
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
