// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/postgres_store/postgres_session_store.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <memory>
#include <utility>

#include "absl/strings/escaping.h"
#include <sys/random.h>

#include "core/base/status_macros.h"
#include "server/postgres_store/postgres_pages.h"
#include "server/store/store_errors.h"
#include "server/store/store_records.h"
#include "server/store/store_rows.h"

namespace tissueform {
namespace {

#define TF_POSTGRES_SESSIONS                                                                     \
  "SELECT id, owner, record, etag, epoch, handles, poses, created_s, last_used_s FROM sessions " \
  "JOIN session_states ON session_states.key = sessions.key "

// Random, so that an etag never comes again, on whatever server it is made.
std::string RandomEtag() {
  std::array<char, 8> bytes{};
  if (getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) std::abort();
  return absl::BytesToHexString({bytes.data(), bytes.size()});
}

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

// What decides about a write; nobody else changes it until the transaction's end.
struct LockedState {
  int64_t key = 0;
  std::string etag;
  int64_t epoch = 0;
  int64_t handles = 0;
  int64_t created_s = 0;
  int64_t last_used_s = 0;
};

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

// The bytes of the two rows. Poses have a row of their own.
struct SealedSession {
  explicit SealedSession(SessionRecord session) : poses(Seal(SerializePoses(session.last_poses))) {
    session.last_poses.clear();
    record = Seal(SerializeRecord(session));
  }

  std::string record;
  std::string poses;
};

absl::Status InsertSession(PostgresTransaction& transaction, const SessionRecord& record) {
  const SealedSession sealed(record);
  TF_ASSIGN_OR_RETURN(
      const PostgresRows rows,
      transaction.Query("INSERT INTO sessions (id, owner, record) VALUES ($1, $2, $3) ON CONFLICT "
                        "(id) DO NOTHING RETURNING key",
                        {record.id, record.owner, sealed.record}));
  if (rows.empty()) return SessionExists(record.id);
  return transaction.Run(
      "INSERT INTO session_states (key, etag, epoch, handles, poses, created_s, last_used_s) "
      "VALUES "
      "($1, $2, $3, $4, $5, $6, $7)",
      {rows.Integer(0, 0), record.etag, record.epoch, static_cast<int64_t>(record.handles.size()),
       sealed.poses, record.created_s, record.last_used_s});
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

// In one statement where it may be kept, which is the rule; why it may not be is asked afterwards.
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

}  // namespace

PostgresSessionStore::PostgresSessionStore(PostgresPool* pool, UnixClock clock)
    // Half of the connections: reads and writes of blobs find some, too.
    : pool_(pool), clock_(std::move(clock)), jobs_((pool->options().max_connections + 1) / 2) {}

void PostgresSessionStore::Submit(const std::string& key, PostgresPool::Work work,
                                  StatusCallback done) {
  const auto deadline = PostgresPool::Clock::now() + pool_->options().patience;
  jobs_.Submit(key, [this, deadline, work = std::move(work), done = std::move(done)] {
    done(pool_->Run(work, deadline));
  });
}

template <typename Result>
void PostgresSessionStore::Ask(const std::string& key,
                               std::function<absl::StatusOr<Result>(PostgresTransaction&)> work,
                               std::function<void(absl::StatusOr<Result>)> done) {
  auto result = std::make_shared<absl::StatusOr<Result>>();
  Submit(
      key,
      [result, work = std::move(work)](PostgresTransaction& transaction) {
        *result = work(transaction);
        return result->status();
      },
      [result, done = std::move(done)](absl::Status status) {
        done(status.ok() ? *std::move(result) : std::move(status));
      });
}

void PostgresSessionStore::Create(SessionRecord record, int64_t epoch, RecordCallback done) {
  if (record.id.empty()) {
    done(absl::InvalidArgumentError("a session record needs an id"));
    return;
  }
  record.epoch = epoch;
  record.etag = RandomEtag();
  record.created_s = clock_();
  record.last_used_s = record.created_s;
  const std::string id = record.id;
  Ask<SessionRecord>(
      id,
      [record =
           std::move(record)](PostgresTransaction& transaction) -> absl::StatusOr<SessionRecord> {
        TF_RETURN_IF_ERROR(InsertSession(transaction, record));
        return record;
      },
      std::move(done));
}

void PostgresSessionStore::Get(const std::string& id, RecordCallback done) {
  Ask<SessionRecord>(
      id,
      [id](PostgresTransaction& transaction) -> absl::StatusOr<SessionRecord> {
        TF_ASSIGN_OR_RETURN(const PostgresRows rows,
                            transaction.Query(TF_POSTGRES_SESSIONS "WHERE id = $1", {id}));
        if (rows.empty()) return NoSession(id);
        return ReadSessionColumns(rows, 0);
      },
      std::move(done));
}

void PostgresSessionStore::Update(SessionRecord record, int64_t epoch, RecordCallback done) {
  const std::string id = record.id;
  Ask<SessionRecord>(
      id,
      [record = std::move(record), epoch,
       now_s = clock_()](PostgresTransaction& transaction) -> absl::StatusOr<SessionRecord> {
        TF_ASSIGN_OR_RETURN(const LockedState state, LockState(transaction, record.id));
        // A record without an etag was not read from here.
        TF_RETURN_IF_ERROR(CheckSessionWrite(record.id, record.etag.empty() ? "none" : record.etag,
                                             epoch, state.etag, state.epoch));
        SessionRecord next = record;
        next.etag = RandomEtag();
        next.epoch = epoch;
        next.created_s = state.created_s;
        next.last_used_s = std::max(state.last_used_s, now_s);
        TF_RETURN_IF_ERROR(ReplaceSession(transaction, state.key, next));
        return next;
      },
      std::move(done));
}

void PostgresSessionStore::CommitPoses(const std::string& id, std::vector<HandlePose> poses,
                                       int64_t epoch, StatusCallback done) {
  Submit(
      id,
      [id, count = static_cast<int64_t>(poses.size()), bytes = Seal(SerializePoses(poses)), epoch,
       now_s = clock_()](PostgresTransaction& transaction) {
        return CommitRow(transaction, id, count, bytes, epoch, now_s);
      },
      std::move(done));
}

void PostgresSessionStore::Delete(const std::string& id, const std::string& etag, int64_t epoch,
                                  StatusCallback done) {
  Submit(
      id,
      [id, etag, epoch](PostgresTransaction& transaction) -> absl::Status {
        TF_ASSIGN_OR_RETURN(const LockedState state, LockState(transaction, id));
        TF_RETURN_IF_ERROR(CheckSessionWrite(id, etag, epoch, state.etag, state.epoch));
        return transaction.Run("DELETE FROM sessions WHERE key = $1", {state.key});
      },
      std::move(done));
}

void PostgresSessionStore::List(const ListRequest& request, PageCallback done) {
  if (request.limit < 1) {
    done(BadLimit(request.limit));
    return;
  }
  Ask<Page>(
      request.after,
      [request](PostgresTransaction& transaction) -> absl::StatusOr<Page> {
        const std::string owner = request.owner.value_or("");
        const std::string also = PostgresNames(request.also);
        TF_ASSIGN_OR_RETURN(
            const PostgresRows rows,
            transaction.Query(TF_POSTGRES_SESSIONS
                              "WHERE id > $1 AND ($2::bigint = 1 OR owner = $3 OR id = ANY "
                              "(string_to_array($4, chr(31)))) ORDER BY id LIMIT $5",
                              {request.after, int64_t{!request.owner.has_value()}, owner, also,
                               RowsOfPage(request.limit)}));
        return ReadPostgresPage<Page>(rows, request.limit, 0, ReadSessionColumns);
      },
      std::move(done));
}

void PostgresSessionStore::Touch(std::vector<std::string> ids, int64_t now_s, StatusCallback done) {
  // Rows are locked by key, rising, so that two servers do not wait for each other.
  Submit(
      "",
      [names = PostgresNames(ids), now_s](PostgresTransaction& transaction) {
        return transaction.Run(
            "UPDATE session_states SET last_used_s = $1 WHERE last_used_s < $1 AND key IN (SELECT "
            "session_states.key FROM session_states JOIN sessions ON sessions.key = "
            "session_states.key WHERE id = ANY (string_to_array($2, chr(31))) ORDER BY "
            "session_states.key FOR UPDATE OF session_states)",
            {now_s, names});
      },
      std::move(done));
}

void PostgresSessionStore::ListUnused(int64_t before_s, int limit, PageCallback done) {
  if (limit < 1) {
    done(BadLimit(limit));
    return;
  }
  Ask<Page>(
      "",
      [before_s, limit](PostgresTransaction& transaction) -> absl::StatusOr<Page> {
        TF_ASSIGN_OR_RETURN(
            const PostgresRows rows,
            transaction.Query(TF_POSTGRES_SESSIONS
                              "WHERE last_used_s < $1 ORDER BY last_used_s, id LIMIT $2",
                              {before_s, int64_t{limit}}));
        return ReadPostgresPage<Page>(rows, limit, 0, ReadSessionColumns);
      },
      std::move(done));
}

}  // namespace tissueform
