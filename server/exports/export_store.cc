// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/exports/export_store.h"

#include <utility>

#include "core/base/status_macros.h"
#include "server/store/store_records.h"

namespace tissueform {
namespace {

using Records = std::vector<ExportRecord>;

}  // namespace

absl::StatusOr<Records> SqlExportStore::Load() {
  return ReadSql<Records>(database_, [](SqlTransaction& transaction) -> absl::StatusOr<Records> {
    TF_ASSIGN_OR_RETURN(const SqlRows rows,
                        transaction.Query("SELECT name, record FROM exports ORDER BY name", {}));
    Records records;
    for (size_t row = 0; row < rows.size(); ++row) {
      const absl::StatusOr<absl::string_view> bytes = Unseal(rows.Text(row, 1));
      if (!bytes.ok()) continue;
      absl::StatusOr<ExportRecord> record = ParseExport(*bytes);
      if (record.ok() && record->id == rows.Text(row, 0)) records.push_back(*std::move(record));
    }
    return records;
  });
}

absl::Status SqlExportStore::Put(const ExportRecord& record) {
  const std::string bytes = Seal(SerializeExport(record));
  return database_->Run({.work = [&](SqlTransaction& transaction) -> absl::Status {
    // An identical stored record comes from a commit whose answer was lost.
    TF_ASSIGN_OR_RETURN(
        const SqlRows rows,
        record.version <= 1
            ? transaction.Query(
                  "INSERT INTO exports (name, record, version) VALUES ($1, $2, $3) ON CONFLICT "
                  "(name) DO UPDATE SET record = excluded.record WHERE exports.record = "
                  "excluded.record RETURNING 1",
                  {record.id, SqlBytes{bytes}, record.version})
            : transaction.Query("UPDATE exports SET record = $2, version = $3 WHERE name = $1 AND "
                                "(version IN ($3::bigint - 1, 0) OR record = $2) RETURNING 1",
                                {record.id, SqlBytes{bytes}, record.version}));
    return rows.empty() ? StaleExport(record.id) : absl::OkStatus();
  }});
}

absl::Status SqlExportStore::Erase(const std::vector<std::string>& ids) {
  const std::string names = SqlNames(ids);
  return database_->Run(
      {.work =
           [&](SqlTransaction& transaction) {
             return transaction.Run(
                 "DELETE FROM exports WHERE name = ANY (string_to_array($1, chr(31)))", {names});
           },
       .erases = true});
}

}  // namespace tissueform
