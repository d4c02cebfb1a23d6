// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/store_schema.h"

#include <array>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "server/platform/storage/fault_points.h"
#include "server/store/session_record.h"
#include "server/store/sqlite_database.h"
#include "server/store/store_index.h"
#include "server/store/store_records.h"

namespace tissueform {
namespace {

constexpr int64_t kApplicationId = 0x54'69'73'46;  // "TisF": file(1) and we know the database by it

constexpr char kTablesOfVersion1[] =
    "CREATE TABLE sessions (key INTEGER PRIMARY KEY, id TEXT NOT NULL UNIQUE, "
    "owner TEXT NOT NULL, record BLOB NOT NULL) STRICT;"
    "CREATE TABLE session_states (key INTEGER PRIMARY KEY REFERENCES sessions(key) ON DELETE "
    "CASCADE, etag TEXT NOT NULL, epoch INTEGER NOT NULL, handles INTEGER NOT NULL, "
    "poses BLOB NOT NULL) STRICT;"
    "CREATE TABLE meshes (key INTEGER PRIMARY KEY, sha256 TEXT NOT NULL UNIQUE, "
    "record BLOB NOT NULL) STRICT;";

constexpr char kVersion2[] =
    "ALTER TABLE session_states ADD COLUMN created_s INTEGER NOT NULL DEFAULT 0;"
    "ALTER TABLE session_states ADD COLUMN last_used_s INTEGER NOT NULL DEFAULT 0;"
    "ALTER TABLE meshes ADD COLUMN last_used_s INTEGER NOT NULL DEFAULT 0;"
    "CREATE TABLE predictions (key INTEGER PRIMARY KEY, id TEXT NOT NULL UNIQUE, "
    "owner TEXT NOT NULL, session TEXT NOT NULL, positions_sha256 TEXT NOT NULL, "
    "record BLOB NOT NULL) STRICT;"
    "CREATE INDEX predictions_by_positions ON predictions(positions_sha256);";

constexpr char kVersion3[] =
    "ALTER TABLE predictions ADD COLUMN case_sha256 TEXT NOT NULL DEFAULT '';"
    "CREATE TABLE cases (key INTEGER PRIMARY KEY, sha256 TEXT NOT NULL UNIQUE, "
    "owner TEXT NOT NULL, record BLOB NOT NULL, last_used_s INTEGER NOT NULL) STRICT;";

// Each user who has sent a file has a case of it.
constexpr char kVersion4[] =
    "CREATE TABLE owned_cases (key INTEGER PRIMARY KEY, sha256 TEXT NOT NULL, owner TEXT NOT NULL, "
    "record BLOB NOT NULL, last_used_s INTEGER NOT NULL, UNIQUE (sha256, owner)) STRICT;"
    "INSERT INTO owned_cases SELECT key, sha256, owner, record, last_used_s FROM cases;"
    "DROP TABLE cases;"
    "ALTER TABLE owned_cases RENAME TO cases;"
    "CREATE TABLE shares (key INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, "
    "record BLOB NOT NULL) STRICT;"
    "CREATE TABLE follow_links (key INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, "
    "record BLOB NOT NULL) STRICT;"
    "CREATE TABLE mesh_rights (key INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, "
    "record BLOB NOT NULL) STRICT;";

constexpr char kVersion5[] =
    "CREATE TABLE exports (key INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, "
    "record BLOB NOT NULL) STRICT;";

constexpr char kVersion6[] =
    "ALTER TABLE sessions ADD COLUMN mesh TEXT;"
    "CREATE INDEX sessions_by_mesh ON sessions(mesh);"
    "ALTER TABLE exports ADD COLUMN version INTEGER NOT NULL DEFAULT 0;";

constexpr char kVersion7[] =
    "ALTER TABLE sessions ADD COLUMN mesh_sha256 TEXT NOT NULL DEFAULT '';"
    "ALTER TABLE sessions ADD COLUMN project TEXT NOT NULL DEFAULT '';"
    "CREATE INDEX sessions_by_mesh_sha256 ON sessions(mesh_sha256, owner);"
    "CREATE INDEX sessions_by_owner ON sessions(owner, project);"
    "ALTER TABLE predictions ADD COLUMN mesh_sha256 TEXT NOT NULL DEFAULT '';"
    "ALTER TABLE predictions ADD COLUMN bytes INTEGER NOT NULL DEFAULT 0;"
    "CREATE INDEX predictions_by_mesh_sha256 ON predictions(mesh_sha256, owner);"
    "CREATE INDEX predictions_by_owner ON predictions(owner, session);"
    "ALTER TABLE cases ADD COLUMN project TEXT NOT NULL DEFAULT '';"
    "ALTER TABLE cases ADD COLUMN bytes INTEGER NOT NULL DEFAULT 0;"
    "CREATE INDEX cases_by_owner ON cases(owner, project);"
    "ALTER TABLE shares ADD COLUMN owner TEXT NOT NULL DEFAULT '';"
    "ALTER TABLE shares ADD COLUMN resource TEXT NOT NULL DEFAULT '';"
    "ALTER TABLE shares ADD COLUMN principal TEXT NOT NULL DEFAULT '';"
    "CREATE INDEX shares_by_principal ON shares(principal, owner, resource);"
    "CREATE INDEX shares_by_resource ON shares(resource, owner);"
    "ALTER TABLE follow_links ADD COLUMN session TEXT NOT NULL DEFAULT '';"
    "ALTER TABLE follow_links ADD COLUMN maker TEXT NOT NULL DEFAULT '';"
    "ALTER TABLE follow_links ADD COLUMN expires_s INTEGER NOT NULL DEFAULT 0;"
    "CREATE INDEX follow_links_by_session ON follow_links(session);"
    "ALTER TABLE mesh_rights ADD COLUMN principal TEXT NOT NULL DEFAULT '';"
    "ALTER TABLE mesh_rights ADD COLUMN sha256 TEXT NOT NULL DEFAULT '';"
    "ALTER TABLE mesh_rights ADD COLUMN bytes INTEGER NOT NULL DEFAULT 0;"
    "CREATE INDEX mesh_rights_by_principal ON mesh_rights(principal);"
    "CREATE INDEX mesh_rights_by_sha256 ON mesh_rights(sha256);";

absl::StatusOr<int64_t> Pragma(Database& database, const char* sql) {
  Database::Query query = database.Prepare(sql);
  TF_ASSIGN_OR_RETURN(const bool row, query.Step());
  return row ? query.Integer(0) : 0;
}

// Fills the column for sessions of version 5. store_check.h sets damaged ones aside later.
absl::Status FillMeshesOfSessions(Database& database) {
  std::vector<std::pair<int64_t, std::string>> meshes;
  {
    Database::Query query = database.Prepare("SELECT key, record FROM sessions");
    for (;;) {
      TF_ASSIGN_OR_RETURN(const bool found, query.Step());
      if (!found) break;
      const absl::StatusOr<absl::string_view> bytes = Unseal(query.Bytes(1));
      if (!bytes.ok()) continue;
      const absl::StatusOr<SessionRecord> record = ParseRecord(*bytes);
      if (record.ok()) meshes.emplace_back(query.Integer(0), record->mesh_sha256);
    }
  }
  for (const auto& [key, mesh] : meshes) {
    TF_RETURN_IF_ERROR(database
                           .Prepare("UPDATE sessions SET mesh = (SELECT sha256 FROM meshes WHERE "
                                    "sha256 = ?) WHERE key = ?")
                           .Bind(mesh)
                           .Bind(key)
                           .Run());
  }
  return absl::OkStatus();
}

absl::Status Change(Database& database, int64_t version, int64_t now_s) {
  if (version < 1) TF_RETURN_IF_ERROR(database.Execute(kTablesOfVersion1));
  if (version < 2) {
    TF_RETURN_IF_ERROR(database.Execute(kVersion2));
    TF_RETURN_IF_ERROR(database.Execute(
        absl::StrCat("UPDATE session_states SET created_s = ", now_s, ", last_used_s = ", now_s,
                     ";", "UPDATE meshes SET last_used_s = ", now_s)));
  }
  if (version < 3) TF_RETURN_IF_ERROR(database.Execute(kVersion3));
  if (version < 4) TF_RETURN_IF_ERROR(database.Execute(kVersion4));
  if (version < 5) TF_RETURN_IF_ERROR(database.Execute(kVersion5));
  if (version < 6) {
    TF_RETURN_IF_ERROR(database.Execute(kVersion6));
    TF_RETURN_IF_ERROR(FillMeshesOfSessions(database));
  }
  if (version < 7) {
    TF_RETURN_IF_ERROR(database.Execute(kVersion7));
    TF_RETURN_IF_ERROR(OnSqlite(FillIndex)(database));
  }
  TF_RETURN_IF_ERROR(database.Execute(absl::StrCat("PRAGMA application_id=", kApplicationId,
                                                   ";PRAGMA user_version=", kSchemaVersion)));
  TF_FAULT_POINT("schema.changed");
  return database.Execute("COMMIT");
}

// Including the key.
int CountColumns(const StoredTable& table) {
  return static_cast<int>(absl::string_view(table.types).size()) + 1;
}

std::string SelectAll(const StoredTable& table, absl::string_view order) {
  return absl::StrCat("SELECT key, ", table.columns, " FROM ", table.name, " ORDER BY key", order);
}

std::string InsertRow(const StoredTable& table) {
  std::string parameters = "?1";
  for (int column = 2; column <= CountColumns(table); ++column) {
    absl::StrAppend(&parameters, ", ?", column);
  }
  return absl::StrCat("INSERT OR IGNORE INTO ", table.name, " (key, ", table.columns, ") SELECT ",
                      parameters,
                      table.name == absl::string_view("session_states")
                          ? " WHERE EXISTS (SELECT 1 FROM sessions WHERE key = ?1)"
                          : "");
}

// True at the end of the table, false at a page that cannot be read.
absl::StatusOr<bool> CopyRows(Database& damaged, Database& fresh, const StoredTable& table,
                              const std::string& select, const std::string& insert_row) {
  Database::Query rows = damaged.Prepare(select.c_str());
  for (;;) {
    const absl::StatusOr<bool> row = rows.Step();
    if (!row.ok() || !*row) return row.ok();
    Database::Query insert = fresh.Prepare(insert_row.c_str());
    for (int column = 0; column < CountColumns(table); ++column) rows.CopyColumn(column, &insert);
    // A row may be readable and yet not fit into the tables; only a full disk ends the copy.
    if (const absl::Status status = insert.Run(); absl::IsResourceExhausted(status)) return status;
  }
}

}  // namespace

absl::StatusOr<int64_t> SchemaVersionOf(Database& database) {
  TF_ASSIGN_OR_RETURN(const int64_t version, Pragma(database, "PRAGMA user_version"));
  TF_ASSIGN_OR_RETURN(const int64_t application, Pragma(database, "PRAGMA application_id"));
  TF_ASSIGN_OR_RETURN(const int64_t pages, Pragma(database, "SELECT count(*) FROM sqlite_schema"));
  if (application != kApplicationId && (application != 0 || pages > 0 || version != 0)) {
    return absl::FailedPreconditionError(absl::StrCat(
        "database ", database.path(), " does not belong to tissueform; name another --data-dir"));
  }
  if (version > kSchemaVersion) {
    return absl::FailedPreconditionError(
        absl::StrCat("database ", database.path(), " was written by a newer server (version ",
                     version, ", this one knows ", kSchemaVersion,
                     "); start the newer server, or name another --data-dir"));
  }
  return version;
}

absl::Status PrepareSchema(Database& database, int64_t now_s) {
  TF_ASSIGN_OR_RETURN(const int64_t version, SchemaVersionOf(database));
  if (version == kSchemaVersion) return absl::OkStatus();
  TF_RETURN_IF_ERROR(database.Execute("BEGIN IMMEDIATE"));
  absl::Cleanup roll_back = [&database] {
    if (database.in_transaction()) database.Execute("ROLLBACK").IgnoreError();
  };
  return Change(database, version, now_s);
}

absl::Status QuickCheck(Database& database) {
  Database::Query query = database.Prepare("PRAGMA quick_check(1)");
  TF_ASSIGN_OR_RETURN(const bool row, query.Step());
  if (row && query.Text(0) == "ok") return absl::OkStatus();
  return absl::DataLossError(row ? query.Text(0) : "quick_check returned nothing");
}

absl::Status CopyReadableRows(Database& damaged, Database& fresh) {
  TF_RETURN_IF_ERROR(fresh.Execute("BEGIN IMMEDIATE"));
  absl::Cleanup roll_back = [&fresh] {
    if (fresh.in_transaction()) fresh.Execute("ROLLBACK").IgnoreError();
  };
  // Database caches statements by address, so the texts must outlive their use.
  std::vector<std::array<std::string, 3>> statements;
  statements.reserve(kStoredTables.size());
  for (const StoredTable& table : kStoredTables) {
    statements.push_back({SelectAll(table, ""), SelectAll(table, " DESC"), InsertRow(table)});
  }
  for (size_t i = 0; i < kStoredTables.size(); ++i) {
    const auto& [rising, falling, insert] = statements[i];
    TF_ASSIGN_OR_RETURN(const bool whole,
                        CopyRows(damaged, fresh, kStoredTables[i], rising, insert));
    if (whole) continue;
    TF_RETURN_IF_ERROR(CopyRows(damaged, fresh, kStoredTables[i], falling, insert).status());
  }
  return fresh.Execute("COMMIT");
}

}  // namespace tissueform
