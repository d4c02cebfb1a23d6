// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/store/postgres_store/postgres_connection.h"
#include "server/store/session_record.h"

// The two rows of a session, and the statements that change them.
namespace tissueform {

#define TF_POSTGRES_SESSIONS                                                                     \
  "SELECT id, owner, record, etag, epoch, handles, poses, created_s, last_used_s FROM sessions " \
  "JOIN session_states ON session_states.key = sessions.key "

// A row of that selection. Errors: DataLoss.
absl::StatusOr<SessionRecord> ReadSessionColumns(const PostgresRows& rows, size_t row);

// What decides about a write; nobody else changes it until the transaction's end.
struct LockedState {
  int64_t key = 0;
  std::string etag;
  int64_t epoch = 0;
  int64_t handles = 0;
  int64_t created_s = 0;
  int64_t last_used_s = 0;
};

// Errors: NotFound.
absl::StatusOr<LockedState> LockState(PostgresTransaction& transaction, const std::string& id);

// The mesh that it is made from is not deleted until the transaction's end. Errors: NotFound.
absl::Status LockMeshOfSession(PostgresTransaction& transaction, const SessionRecord& record);

// Under the record's epoch, or one that is given (kFreshEpoch): returns it. Its mesh cannot be
// deleted any longer, where it is there. Errors: AlreadyExists.
absl::StatusOr<int64_t> InsertSession(PostgresTransaction& transaction,
                                      const SessionRecord& record);

absl::Status ReplaceSession(PostgresTransaction& transaction, int64_t key,
                            const SessionRecord& record);

// Keeps sealed poses, `count` of them, as SessionStore::CommitPoses does: in one statement where
// they may be kept, which is the rule; why not is asked afterwards.
absl::Status CommitRow(PostgresTransaction& transaction, const std::string& id, int64_t count,
                       const std::string& poses, int64_t epoch, int64_t now_s);

}  // namespace tissueform
