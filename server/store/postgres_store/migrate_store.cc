// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/migrate_store.h"

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "server/store/postgres_store/postgres_schema.h"
#include "server/store/sql_case_store.h"
#include "server/store/sql_mesh_store.h"
#include "server/store/sql_prediction_store.h"
#include "server/store/store_rows.h"
#include "server/store/store_schema.h"

namespace tissueform {
namespace {

constexpr int64_t kMigrationPage = 100;

absl::Status CheckEmpty(PostgresPool* pool) {
  return pool->Run([&](PostgresTransaction& transaction) -> absl::Status {
    for (const char* table :
         {"sessions", "blobs", "shares", "follow_links", "mesh_rights", "exports"}) {
      const std::string sql = absl::StrCat("SELECT 1 FROM ", table, " LIMIT 1");
      TF_ASSIGN_OR_RETURN(const SqlRows rows, transaction.Query(sql.c_str(), {}));
      if (rows.empty()) continue;
      return absl::FailedPreconditionError(absl::StrCat("database ", pool->target().name,
                                                        " is not empty (there are ", table,
                                                        "); name one that is"));
    }
    return absl::OkStatus();
  });
}

absl::Status CopyBlob(SqlStores* from, const BlobClaim& claim, SqlStores* to) {
  std::unique_ptr<SqlBlobs::Incoming> copy;
  const auto begin = [&](SqlTransaction&) -> absl::StatusOr<BlobClaim> {
    TF_ASSIGN_OR_RETURN(copy, to->blobs().Receive());
    return claim;
  };
  TF_RETURN_IF_ERROR(
      from->blobs().Read(begin, [&copy](absl::string_view piece) { return copy->Append(piece); }));
  // Its rows are copied later, with their tables.
  return copy->Keep(claim.sha256, [](SqlTransaction&) { return absl::OkStatus(); });
}

// Copies the blobs claimed by the rows of `select`, which returns up to $2 rows with names greater
// than $1, ordered by `name_column`.
template <typename Read>
absl::Status CopyBlobs(SqlStores* from, SqlStores* to, const char* select, size_t name_column,
                       Read read) {
  std::string after;
  for (;;) {
    TF_ASSIGN_OR_RETURN(const SqlRows rows,
                        ReadSql<SqlRows>(&from->database(), [&](SqlTransaction& transaction) {
                          return transaction.Query(select, {after, kMigrationPage});
                        }));
    if (rows.empty()) return absl::OkStatus();
    for (size_t row = 0; row < rows.size(); ++row) {
      TF_ASSIGN_OR_RETURN(const auto record, read(rows, row));
      TF_RETURN_IF_ERROR(CopyBlob(from, ClaimOf(record), to));
    }
    after = std::string(rows.Text(rows.size() - 1, name_column));
  }
}

absl::Status CopyAllBlobs(SqlStores* from, SqlStores* to) {
  TF_RETURN_IF_ERROR(CopyBlobs(
      from, to, TF_SELECT_MESHES "WHERE sha256 > $1 ORDER BY sha256 LIMIT $2", 0, ReadMesh));
  TF_RETURN_IF_ERROR(CopyBlobs(from, to, TF_SELECT_PREDICTIONS "WHERE id > $1 ORDER BY id LIMIT $2",
                               0, ReadPrediction));
  // Cases with the same name share one blob, so a page may end between them.
  return CopyBlobs(from, to, TF_SELECT_CASES "WHERE sha256 > $1 ORDER BY sha256 LIMIT $2", 0,
                   ReadCase);
}

// Statements that read a table in pages and write it.
struct CopyStatements {
  explicit CopyStatements(const StoredTable& table)
      : select(absl::StrCat("SELECT key, ", table.columns, " FROM ", table.name,
                            " WHERE key > $1 ORDER BY key LIMIT $2")),
        insert(absl::StrCat("INSERT INTO ", table.name, " (key, ", table.columns,
                            ") OVERRIDING SYSTEM VALUE VALUES ($1")) {
    const bool of_sessions = table.name == absl::string_view("sessions");
    const auto columns = absl::string_view(table.types).size();
    for (size_t column = 0; column < columns; ++column) {
      const std::string parameter = absl::StrCat("$", column + 2);
      // The mesh of a session may have been deleted.
      absl::StrAppend(
          &insert, ", ",
          of_sessions && column + 1 == columns
              ? absl::StrCat("(SELECT sha256 FROM meshes WHERE sha256 = ", parameter, ")")
              : parameter);
    }
    insert += ")";
  }

  std::string select;
  std::string insert;
};

// Never freed: SQLite's driver caches statements by address.
const CopyStatements& StatementsOf(const StoredTable& table) {
  static const auto* const all = [] {
    auto* statements = new std::map<absl::string_view, CopyStatements>;
    for (const StoredTable& each : kStoredTables) {
      statements->emplace(each.name, CopyStatements(each));
    }
    return statements;
  }();
  return all->at(table.name);
}

std::vector<SqlValue> ValuesOf(const SqlRows& rows, size_t row, absl::string_view types) {
  std::vector<SqlValue> values = {rows.Integer(row, 0)};
  for (size_t column = 1; column <= types.size(); ++column) {
    switch (types[column - 1]) {
      case 'i':
        values.emplace_back(rows.Integer(row, column));
        break;
      case 'b':
        values.emplace_back(SqlBytes{rows.Text(row, column)});
        break;
      default:
        values.emplace_back(rows.Text(row, column));
    }
  }
  return values;
}

// Returns the number of rows.
absl::StatusOr<int64_t> CopyTable(SqlStores* from, const StoredTable& table, PostgresPool* to) {
  const CopyStatements& statements = StatementsOf(table);
  int64_t count = 0;
  int64_t after = 0;
  for (;;) {
    TF_ASSIGN_OR_RETURN(
        const SqlRows rows, ReadSql<SqlRows>(&from->database(), [&](SqlTransaction& transaction) {
          return transaction.Query(statements.select.c_str(), {after, kMigrationPage});
        }));
    if (rows.empty()) return count;
    const auto insert = [&](PostgresTransaction& transaction) -> absl::Status {
      for (size_t row = 0; row < rows.size(); ++row) {
        TF_RETURN_IF_ERROR(
            transaction.Run(statements.insert.c_str(), ValuesOf(rows, row, table.types)));
      }
      return absl::OkStatus();
    };
    TF_RETURN_IF_ERROR(to->Run(insert));
    count += static_cast<int64_t>(rows.size());
    after = rows.Integer(rows.size() - 1, 0);
  }
}

// Sets the sequences above all copied keys and epochs.
absl::Status GoOnCounting(PostgresPool* pool) {
  return pool->Run([](PostgresTransaction& transaction) -> absl::Status {
    for (const StoredTable& table : kStoredTables) {
      // Its key is the session's, without a sequence.
      if (table.name == absl::string_view("session_states")) continue;
      TF_RETURN_IF_ERROR(transaction.Execute(absl::StrCat("SELECT setval(pg_get_serial_sequence('",
                                                          table.name, "', 'key'), max(key)) FROM ",
                                                          table.name, " HAVING max(key) > 0")));
    }
    return RaiseSessionEpochs(transaction);
  });
}

}  // namespace

absl::StatusOr<MigrationSummary> MigrateStore(SqlStores* from, PostgresStores* to) {
  TF_RETURN_IF_ERROR(CheckEmpty(to->pool()));
  TF_RETURN_IF_ERROR(CopyAllBlobs(from, to));
  std::map<std::string, int64_t> counts;
  for (const StoredTable& table : kStoredTables) {
    TF_ASSIGN_OR_RETURN(counts[table.name], CopyTable(from, table, to->pool()));
  }
  TF_RETURN_IF_ERROR(GoOnCounting(to->pool()));
  return MigrationSummary{
      .sessions = counts["sessions"],
      .meshes = counts["meshes"],
      .predictions = counts["predictions"],
      .cases = counts["cases"],
      .access_rows = counts["shares"] + counts["follow_links"] + counts["mesh_rights"],
      .exports = counts["exports"]};
}

}  // namespace tissueform
