// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/sql_session_store.h"

#include <algorithm>
#include <functional>

#include "core/base/random_id.h"
#include "core/base/status_macros.h"
#include "server/store/access_queries.h"
#include "server/store/store_errors.h"
#include "server/store/store_records.h"
#include "server/store/store_rows.h"

namespace tissueform {
namespace {

// Random, so etags never repeat and no counter has to be stored.
std::string NewEtag() { return RandomId(); }

// The row's state that a write is checked against, locked until the transaction ends.
struct LockedState {
  int64_t key = 0;
  std::string etag;
  int64_t epoch = 0;
  int64_t handles = 0;
  int64_t created_s = 0;
  int64_t last_used_s = 0;
};

// Errors: NotFound.
absl::StatusOr<LockedState> LockState(SqlTransaction& transaction, const std::string& id) {
  TF_ASSIGN_OR_RETURN(
      const SqlRows rows,
      transaction.Query("SELECT session_states.key, etag, epoch, handles, created_s, last_used_s "
                        "FROM sessions JOIN session_states ON session_states.key = sessions.key "
                        "WHERE id = $1 FOR UPDATE",
                        {id}));
  if (rows.empty()) return NoSession(id);
  return LockedState{rows.Integer(0, 0), std::string(rows.Text(0, 1)), rows.Integer(0, 2),
                     rows.Integer(0, 3), rows.Integer(0, 4),           rows.Integer(0, 5)};
}

// Locks the session's mesh against deletion until the transaction ends. Errors: NotFound.
absl::Status LockMeshOf(SqlTransaction& transaction, const SessionRecord& record) {
  TF_ASSIGN_OR_RETURN(const SqlRows rows,
                      transaction.Query("SELECT 1 FROM meshes WHERE sha256 = $1 FOR KEY SHARE",
                                        {record.mesh_sha256}));
  return rows.empty() ? NoMesh(record.mesh_sha256) : absl::OkStatus();
}

// Returns the epoch: the record's, or a new one for kFreshEpoch. From then on the mesh, if stored,
// cannot be deleted. Errors: AlreadyExists.
absl::StatusOr<int64_t> Insert(SqlTransaction& transaction, const SessionRecord& record) {
  const SealedSession sealed(record);
  TF_ASSIGN_OR_RETURN(const SqlRows rows,
                      transaction.Query("INSERT INTO sessions (id, owner, record, mesh_sha256, "
                                        "project, mesh) VALUES ($1, $2, $3, $4, "
                                        "$5, (SELECT sha256 FROM meshes WHERE sha256 = $4)) ON "
                                        "CONFLICT (id) DO NOTHING RETURNING key",
                                        {record.id, record.owner, SqlBytes{sealed.record},
                                         record.mesh_sha256, record.project}));
  if (rows.empty()) return SessionExists(record.id);
  // After the id was found free: an earlier holder of a session of this id has a lower epoch.
  static_assert(kFreshEpoch == 0);
  TF_ASSIGN_OR_RETURN(
      const SqlRows state,
      transaction.Query(
          "INSERT INTO session_states (key, etag, epoch, handles, poses, created_s, last_used_s) "
          "VALUES ($1, $2, CASE WHEN $3::bigint = 0 THEN nextval('session_epochs') ELSE $3::bigint "
          "END, $4, $5, $6, $7) RETURNING epoch",
          {rows.Integer(0, 0), record.etag, record.epoch,
           static_cast<int64_t>(record.handles.size()), SqlBytes{sealed.poses}, record.created_s,
           record.last_used_s}));
  return state.Integer(0, 0);
}

absl::Status Replace(SqlTransaction& transaction, int64_t key, const SessionRecord& record) {
  const SealedSession sealed(record);
  TF_RETURN_IF_ERROR(
      transaction.Run("UPDATE sessions SET owner = $1, record = $2, project = $3 WHERE key = $4",
                      {record.owner, SqlBytes{sealed.record}, record.project, key}));
  return transaction.Run(
      "UPDATE session_states SET etag = $1, epoch = $2, handles = $3, poses = $4, last_used_s = $5 "
      "WHERE key = $6",
      {record.etag, record.epoch, static_cast<int64_t>(record.handles.size()),
       SqlBytes{sealed.poses}, record.last_used_s, key});
}

absl::StatusOr<SessionRecord> Select(SqlTransaction& transaction, const std::string& id) {
  TF_ASSIGN_OR_RETURN(const SqlRows rows,
                      transaction.Query(TF_SELECT_SESSIONS "WHERE id = $1", {id}));
  if (rows.empty()) return NoSession(id);
  return ReadSession(rows, 0);
}

absl::StatusOr<SessionStore::Page> SelectPage(SqlTransaction& transaction,
                                              const SessionStore::ListRequest& request) {
  TF_ASSIGN_OR_RETURN(
      const SqlRows rows,
      transaction.Query(
          TF_SELECT_SESSIONS "WHERE id > $1 AND ($2::bigint = 1 OR owner = $3 OR id = ANY "
                             "(string_to_array($4, chr(31)))) ORDER BY id LIMIT $5",
          {request.after, int64_t{!request.owner.has_value()}, request.owner.value_or(""),
           SqlNames(request.also), RowsOfPage(request.limit)}));
  return ReadPage<SessionStore::Page>(rows, request.limit, 0, ReadSession);
}

SqlJob ReadJob(SqlWork work) {
  return {.work = std::move(work), .reads = true, .repeatable = true};
}

}  // namespace

absl::Status CommitPoseRow(SqlTransaction& transaction, const std::string& id, int64_t count,
                           const std::string& poses, int64_t epoch, int64_t now_s) {
  TF_ASSIGN_OR_RETURN(
      const SqlRows rows,
      transaction.Query(
          "UPDATE session_states SET poses = $1, epoch = $2, last_used_s = GREATEST(last_used_s, "
          "$3) FROM sessions WHERE sessions.key = session_states.key AND id = $4 AND epoch <= $2 "
          "AND ($5::bigint = 0 OR handles = $5) RETURNING 1",
          {SqlBytes{poses}, epoch, now_s, id, count}));
  if (!rows.empty()) return absl::OkStatus();
  TF_ASSIGN_OR_RETURN(const LockedState state, LockState(transaction, id));
  TF_RETURN_IF_ERROR(CheckSessionWrite(id, "", epoch, state.etag, state.epoch));
  TF_RETURN_IF_ERROR(
      CheckPoseCount(id, static_cast<size_t>(count), static_cast<size_t>(state.handles)));
  // The session was created or changed between the two statements.
  return transaction.Run(
      "UPDATE session_states SET poses = $1, epoch = $2, last_used_s = GREATEST(last_used_s, $3) "
      "WHERE key = $4",
      {SqlBytes{poses}, epoch, now_s, state.key});
}

void SqlSessionStore::Create(SessionRecord record, int64_t epoch, RecordCallback done) {
  if (record.id.empty()) {
    done(absl::InvalidArgumentError("a session record needs an id"));
    return;
  }
  record.epoch = epoch;
  record.etag = NewEtag();
  record.created_s = clock_();
  record.last_used_s = record.created_s;
  const std::string id = record.id;
  auto [work, answer] = Returning<SessionRecord>(
      [record = std::move(record),
       shared = database_->shared()](SqlTransaction& transaction) -> absl::StatusOr<SessionRecord> {
        // Another server may have deleted the mesh since it was checked.
        if (shared) TF_RETURN_IF_ERROR(LockMeshOf(transaction, record));
        SessionRecord kept = record;
        TF_ASSIGN_OR_RETURN(kept.epoch, Insert(transaction, record));
        return kept;
      },
      std::move(done));
  database_->Submit(id, {.work = std::move(work)}, std::move(answer));
}

void SqlSessionStore::Get(const std::string& id, RecordCallback done) {
  auto [work, answer] = Returning<SessionRecord>(
      [id](SqlTransaction& transaction) { return Select(transaction, id); }, std::move(done));
  database_->Submit(id, ReadJob(std::move(work)), std::move(answer));
}

void SqlSessionStore::Peek(const std::string& id, RecordCallback done) {
  auto [work, answer] = Returning<SessionRecord>(
      [id](SqlTransaction& transaction) { return Select(transaction, id); }, std::move(done));
  database_->Peek(id, ReadJob(std::move(work)), std::move(answer));
}

void SqlSessionStore::Update(SessionRecord record, int64_t epoch, RecordCallback done) {
  const std::string id = record.id;
  auto [work, answer] = Returning<SessionRecord>(
      [record = std::move(record), epoch,
       now_s = clock_()](SqlTransaction& transaction) -> absl::StatusOr<SessionRecord> {
        TF_ASSIGN_OR_RETURN(const LockedState state, LockState(transaction, record.id));
        // A record without an etag was not read from this store.
        TF_RETURN_IF_ERROR(CheckSessionWrite(record.id, record.etag.empty() ? "none" : record.etag,
                                             epoch, state.etag, state.epoch));
        SessionRecord next = record;
        next.etag = NewEtag();
        next.epoch = epoch;
        next.created_s = state.created_s;
        next.last_used_s = std::max(state.last_used_s, now_s);
        TF_RETURN_IF_ERROR(Replace(transaction, state.key, next));
        return next;
      },
      std::move(done));
  database_->Submit(id, {.work = std::move(work)}, std::move(answer));
}

void SqlSessionStore::CommitPoses(const std::string& id, std::vector<HandlePose> poses,
                                  int64_t epoch, StatusCallback done) {
  // Repeatable: only the holder of the epoch writes, and later calls for this session wait, so
  // these poses are still the newest at a retry.
  database_->Submit(
      id,
      {.work =
           [id, count = static_cast<int64_t>(poses.size()), bytes = Seal(SerializePoses(poses)),
            epoch, now_s = clock_()](SqlTransaction& transaction) {
             return CommitPoseRow(transaction, id, count, bytes, epoch, now_s);
           },
       .repeatable = true},
      std::move(done));
}

void SqlSessionStore::Delete(const std::string& id, const std::string& etag, int64_t epoch,
                             StatusCallback done) {
  database_->Submit(
      id,
      {.work = [id, etag, epoch](SqlTransaction& transaction) -> absl::Status {
         TF_ASSIGN_OR_RETURN(const LockedState state, LockState(transaction, id));
         TF_RETURN_IF_ERROR(CheckSessionWrite(id, etag, epoch, state.etag, state.epoch));
         TF_ASSIGN_OR_RETURN(
             const SqlRows rows,
             transaction.Query("DELETE FROM sessions WHERE key = $1 RETURNING owner", {state.key}));
         return EraseAccessToSession(transaction, std::string(rows.Text(0, 0)), id);
       },
       .erases = true},
      std::move(done));
}

void SqlSessionStore::List(const ListRequest& request, PageCallback done) {
  if (request.limit < 1) {
    done(BadLimit(request.limit));
    return;
  }
  auto [work, answer] = Returning<Page>(
      [request](SqlTransaction& transaction) { return SelectPage(transaction, request); },
      std::move(done));
  database_->Submit(request.after, ReadJob(std::move(work)), std::move(answer));
}

void SqlSessionStore::Touch(std::vector<std::string> ids, int64_t now_s, StatusCallback done) {
  // Rows are locked in order of their keys, so two servers cannot deadlock.
  database_->Submit(
      "",
      {.work =
           [names = SqlNames(ids), now_s](SqlTransaction& transaction) {
             return transaction.Run(
                 "UPDATE session_states SET last_used_s = $1 WHERE last_used_s < $1 AND key IN "
                 "(SELECT session_states.key FROM session_states JOIN sessions ON sessions.key = "
                 "session_states.key WHERE id = ANY (string_to_array($2, chr(31))) ORDER BY "
                 "session_states.key FOR UPDATE OF session_states)",
                 {now_s, names});
           },
       .repeatable = true},
      std::move(done));
}

void SqlSessionStore::ListUnused(int64_t before_s, int limit, PageCallback done) {
  if (limit < 1) {
    done(BadLimit(limit));
    return;
  }
  auto [work, answer] = Returning<Page>(
      [before_s, limit](SqlTransaction& transaction) -> absl::StatusOr<Page> {
        TF_ASSIGN_OR_RETURN(
            const SqlRows rows,
            transaction.Query(TF_SELECT_SESSIONS
                              "WHERE last_used_s < $1 ORDER BY last_used_s, id LIMIT $2",
                              {before_s, int64_t{limit}}));
        return ReadPage<Page>(rows, limit, 0, ReadSession);
      },
      std::move(done));
  database_->Submit("", ReadJob(std::move(work)), std::move(answer));
}

}  // namespace tissueform
