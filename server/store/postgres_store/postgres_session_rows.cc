// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/postgres_session_rows.h"

#include "core/base/status_macros.h"
#include "server/store/session_store.h"
#include "server/store/store_errors.h"
#include "server/store/store_records.h"
#include "server/store/store_rows.h"

namespace tissueform {
namespace {

// The bytes of the two rows. Poses have a row of their own.
struct SealedSession {
  explicit SealedSession(SessionRecord session) : poses(Seal(SerializePoses(session.last_poses))) {
    session.last_poses.clear();
    record = Seal(SerializeRecord(session));
  }

  std::string record;
  std::string poses;
};

}  // namespace

absl::StatusOr<SessionRecord> ReadSessionColumns(const PostgresRows& rows, size_t row) {
  return SessionOf({.id = rows.Text(row, 0),
                    .owner = rows.Text(row, 1),
                    .record = rows.Text(row, 2),
                    .etag = rows.Text(row, 3),
                    .epoch = rows.Integer(row, 4),
                    .handles = rows.Integer(row, 5),
                    .poses = rows.Text(row, 6),
                    .created_s = rows.Integer(row, 7),
                    .last_used_s = rows.Integer(row, 8)});
}

absl::StatusOr<LockedState> LockState(PostgresTransaction& transaction, const std::string& id) {
  TF_ASSIGN_OR_RETURN(
      const PostgresRows rows,
      transaction.Query("SELECT session_states.key, etag, epoch, handles, created_s, last_used_s "
                        "FROM sessions JOIN session_states ON session_states.key = sessions.key "
                        "WHERE id = $1 FOR UPDATE",
                        {id}));
  if (rows.empty()) return NoSession(id);
  return LockedState{rows.Integer(0, 0), std::string(rows.Text(0, 1)), rows.Integer(0, 2),
                     rows.Integer(0, 3), rows.Integer(0, 4),           rows.Integer(0, 5)};
}

absl::Status LockMeshOfSession(PostgresTransaction& transaction, const SessionRecord& record) {
  TF_ASSIGN_OR_RETURN(const PostgresRows rows,
                      transaction.Query("SELECT 1 FROM meshes WHERE sha256 = $1 FOR KEY SHARE",
                                        {record.mesh_sha256}));
  return rows.empty() ? NoMesh(record.mesh_sha256) : absl::OkStatus();
}

absl::StatusOr<int64_t> InsertSession(PostgresTransaction& transaction,
                                      const SessionRecord& record) {
  const SealedSession sealed(record);
  TF_ASSIGN_OR_RETURN(
      const PostgresRows rows,
      transaction.Query("INSERT INTO sessions (id, owner, record, mesh) VALUES ($1, $2, $3, "
                        "(SELECT sha256 FROM meshes WHERE sha256 = $4)) ON CONFLICT "
                        "(id) DO NOTHING RETURNING key",
                        {record.id, record.owner, sealed.record, record.mesh_sha256}));
  if (rows.empty()) return SessionExists(record.id);
  // Only now, that the id is free: whoever held a session of it before has got its epoch by now.
  static_assert(kFreshEpoch == 0);
  TF_ASSIGN_OR_RETURN(
      const PostgresRows state,
      transaction.Query(
          "INSERT INTO session_states (key, etag, epoch, handles, poses, created_s, last_used_s) "
          "VALUES ($1, $2, CASE WHEN $3::bigint = 0 THEN nextval('session_epochs') ELSE $3::bigint "
          "END, $4, $5, $6, $7) RETURNING epoch",
          {rows.Integer(0, 0), record.etag, record.epoch,
           static_cast<int64_t>(record.handles.size()), sealed.poses, record.created_s,
           record.last_used_s}));
  return state.Integer(0, 0);
}

absl::Status ReplaceSession(PostgresTransaction& transaction, int64_t key,
                            const SessionRecord& record) {
  const SealedSession sealed(record);
  TF_RETURN_IF_ERROR(transaction.Run("UPDATE sessions SET owner = $1, record = $2 WHERE key = $3",
                                     {record.owner, sealed.record, key}));
  return transaction.Run(
      "UPDATE session_states SET etag = $1, epoch = $2, handles = $3, poses = $4, last_used_s = $5 "
      "WHERE key = $6",
      {record.etag, record.epoch, static_cast<int64_t>(record.handles.size()), sealed.poses,
       record.last_used_s, key});
}

absl::Status CommitRow(PostgresTransaction& transaction, const std::string& id, int64_t count,
                       const std::string& poses, int64_t epoch, int64_t now_s) {
  TF_ASSIGN_OR_RETURN(
      const PostgresRows rows,
      transaction.Query(
          "UPDATE session_states SET poses = $1, epoch = $2, last_used_s = GREATEST(last_used_s, "
          "$3) FROM sessions WHERE sessions.key = session_states.key AND id = $4 AND epoch <= $2 "
          "AND ($5::bigint = 0 OR handles = $5) RETURNING 1",
          {poses, epoch, now_s, id, count}));
  if (!rows.empty()) return absl::OkStatus();
  TF_ASSIGN_OR_RETURN(const LockedState state, LockState(transaction, id));
  TF_RETURN_IF_ERROR(CheckSessionWrite(id, "", epoch, state.etag, state.epoch));
  TF_RETURN_IF_ERROR(
      CheckPoseCount(id, static_cast<size_t>(count), static_cast<size_t>(state.handles)));
  // It has come, or changed, between the two statements.
  return transaction.Run(
      "UPDATE session_states SET poses = $1, epoch = $2, last_used_s = GREATEST(last_used_s, $3) "
      "WHERE key = $4",
      {poses, epoch, now_s, state.key});
}

}  // namespace tissueform
