// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <cstdint>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/platform/storage/database.h"

namespace tissueform {

// The tables of a store. A record is its sealed bytes (store_records.h); beside it stand only what
// rows are found by and what changes often.
//
//   sessions        id, owner, record without its poses; mesh: its mesh, which cannot be
//                   deleted while the session exists (null: the mesh is not stored); mesh_sha256:
//                   the same name, stored or not; project
//   session_states  what a session's writes change: etag, epoch, poses, times. A row of its own, so
//                   that the commit of a pose writes one small page and not the record.
//   meshes          sha256, record, last_used_s; the payload is the blob sha256
//   predictions     id, owner, session, case_sha256, mesh_sha256, bytes, record; the positions are
//                   the blob positions_sha256
//   cases           sha256, owner, project, bytes, record, last_used_s; the file is the blob sha256
//   shares          name, record, owner, resource, principal (access_rows.h)
//   follow_links    name, record, session, maker, expires_s
//   mesh_rights     name, record, principal, sha256, bytes
//   exports         name, record, version: what is to go to the PACS (server/exports); version 0:
//                   written before version 6
//
// Version 1 had neither times nor predictions, version 2 no cases, version 3 one owner a case and
// no rights, version 4 no exports, version 5 no meshes of sessions, version 6 no columns for
// access_queries.h.
inline constexpr int64_t kSchemaVersion = 7;

// Describes a table for code that copies rows.
struct StoredTable {
  const char* name;
  const char* columns;  // all but the primary key `key`
  const char* types;    // of each column: "i" integer, "t" text, "b" bytes
};
// Referenced tables come before referencing ones.
inline constexpr std::array<StoredTable, 9> kStoredTables = {{
    {"meshes", "sha256, record, last_used_s", "tbi"},
    {"sessions", "id, owner, record, mesh_sha256, project, mesh", "ttbttt"},
    {"session_states", "etag, epoch, handles, poses, created_s, last_used_s", "tiibii"},
    {"predictions", "id, owner, session, positions_sha256, record, case_sha256, mesh_sha256, bytes",
     "ttttbtti"},
    {"cases", "sha256, owner, record, last_used_s, project, bytes", "ttbiti"},
    {"shares", "name, record, owner, resource, principal", "tbttt"},
    {"follow_links", "name, record, session, maker, expires_s", "tbtti"},
    {"mesh_rights", "name, record, principal, sha256, bytes", "tbtti"},
    {"exports", "name, record, version", "tbi"},
}};

// The version of a database of ours; 0 for an empty one. Nothing is changed.
//
// Errors: FailedPrecondition (a newer version, or not a database of ours), or those of Database.
absl::StatusOr<int64_t> SchemaVersionOf(Database& database);

// Makes the tables in an empty database, or brings those of a version before up to date, in one
// transaction; rows that had no times get `now_s`.
//
// Errors: those of SchemaVersionOf.
absl::Status PrepareSchema(Database& database, int64_t now_s);

// OK when SQLite finds nothing wrong with the file; otherwise DataLoss with its first complaint.
absl::Status QuickCheck(Database& database);

// Copies what rows can still be read from a damaged database of this version into an empty one with
// tables. Pages that cannot be read are stepped over from both ends of a table.
absl::Status CopyReadableRows(Database& damaged, Database& fresh);

}  // namespace tissueform
