// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/store/postgres_store/postgres_pool.h"

namespace tissueform {

// The tables of a store that several servers share: those of store_schema.h with the same records,
// and
//
//   tissueform_version  one row: the version
//   session_states      in addition the server that holds the session: holder, node, lease_until.
//                       The epoch of the lease is that of the writes, so that one row decides.
//   sessions            in addition the mesh that it is made from, which cannot be deleted while
//                       the session exists; null when the mesh was damaged and is gone
//   session_epochs      a sequence: the next epoch, for any session. It does not go back, so
//                       nothing is written under the epoch of an earlier session of the same id
//   nodes               servers that use the store now (node_table.h)
//   blobs, blob_pieces  what a data folder keeps as files: rows of 1 MiB, each with its SHA-256
//
// tissueform_now() is the clock of leases. Triggers announce what is deleted or changed for others
// to know in the channel `tissueform_changes` (change_listener.h).
//
// Names are compared byte by byte (COLLATE "C"), as everywhere else.
inline constexpr int64_t kPostgresSchemaVersion = 7;

// Creates the tables if they do not exist, or brings those of a version before up to date, in one
// transaction; servers that start at once take turns.
//
// Errors: FailedPrecondition (a newer version), or those of the pool.
absl::Status PreparePostgresSchema(PostgresPool* pool);

// Epochs that are given from now on are greater than those of all sessions that there are. After
// rows with epochs of another store have been written.
absl::Status RaiseSessionEpochs(PostgresTransaction& transaction);

// The version of the tables; 0 without tables.
absl::StatusOr<int64_t> PostgresSchemaVersion(PostgresTransaction& transaction);

}  // namespace tissueform
