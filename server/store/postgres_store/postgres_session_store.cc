// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/postgres_session_store.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "core/base/random_id.h"
#include "core/base/status_macros.h"
#include "server/store/postgres_store/postgres_pages.h"
#include "server/store/postgres_store/postgres_session_rows.h"
#include "server/store/store_errors.h"
#include "server/store/store_records.h"

namespace tissueform {

PostgresSessionStore::PostgresSessionStore(PostgresPool* pool, UnixClock clock)
    // Half of the connections: reads and writes of blobs find some, too.
    : pool_(pool),
      clock_(std::move(clock)),
      jobs_((pool->options().max_connections + 1) / 2),
      peeks_((pool->options().max_connections + 1) / 2) {}

void PostgresSessionStore::Submit(const std::string& key, PostgresPool::Work work,
                                  Idempotent idempotent, StatusCallback done) {
  const auto deadline = PostgresPool::Clock::now() + pool_->options().patience;
  jobs_.Submit(key, [this, deadline, work = std::move(work), idempotent, done = std::move(done)] {
    done(pool_->Run(work, deadline, idempotent));
  });
}

template <typename Result>
void PostgresSessionStore::Ask(const std::string& key,
                               std::function<absl::StatusOr<Result>(PostgresTransaction&)> work,
                               Idempotent idempotent,
                               std::function<void(absl::StatusOr<Result>)> done) {
  auto result = std::make_shared<absl::StatusOr<Result>>();
  Submit(
      key,
      [result, work = std::move(work)](PostgresTransaction& transaction) {
        *result = work(transaction);
        return result->status();
      },
      idempotent,
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
  record.etag = RandomId();
  record.created_s = clock_();
  record.last_used_s = record.created_s;
  const std::string id = record.id;
  Ask<SessionRecord>(
      id,
      [record =
           std::move(record)](PostgresTransaction& transaction) -> absl::StatusOr<SessionRecord> {
        TF_RETURN_IF_ERROR(LockMeshOfSession(transaction, record));
        SessionRecord kept = record;
        TF_ASSIGN_OR_RETURN(kept.epoch, InsertSession(transaction, record));
        return kept;
      },
      Idempotent::kNo, std::move(done));
}

namespace {

absl::StatusOr<SessionRecord> SelectSession(PostgresTransaction& transaction,
                                            const std::string& id) {
  TF_ASSIGN_OR_RETURN(const PostgresRows rows,
                      transaction.Query(TF_POSTGRES_SESSIONS "WHERE id = $1", {id}));
  if (rows.empty()) return NoSession(id);
  return ReadSessionColumns(rows, 0);
}

}  // namespace

void PostgresSessionStore::Get(const std::string& id, RecordCallback done) {
  Ask<SessionRecord>(
      id, [id](PostgresTransaction& transaction) { return SelectSession(transaction, id); },
      Idempotent::kYes, std::move(done));
}

void PostgresSessionStore::Peek(const std::string& id, RecordCallback done) {
  constexpr std::chrono::milliseconds kMaxPatience{2'000};
  const auto deadline =
      PostgresPool::Clock::now() + std::min(pool_->options().patience, kMaxPatience);
  peeks_.Submit(id, [this, id, deadline, done = std::move(done)] {
    absl::StatusOr<SessionRecord> found;
    const absl::Status status = pool_->Run(
        [&](PostgresTransaction& transaction) {
          found = SelectSession(transaction, id);
          return found.status();
        },
        deadline, Idempotent::kYes);
    done(status.ok() ? std::move(found) : status);
  });
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
        next.etag = RandomId();
        next.epoch = epoch;
        next.created_s = state.created_s;
        next.last_used_s = std::max(state.last_used_s, now_s);
        TF_RETURN_IF_ERROR(ReplaceSession(transaction, state.key, next));
        return next;
      },
      Idempotent::kNo, std::move(done));
}

// Under one epoch nobody else writes meanwhile, and later calls for this session wait: the same
// poses once more are the newest still.
void PostgresSessionStore::CommitPoses(const std::string& id, std::vector<HandlePose> poses,
                                       int64_t epoch, StatusCallback done) {
  Submit(
      id,
      [id, count = static_cast<int64_t>(poses.size()), bytes = Seal(SerializePoses(poses)), epoch,
       now_s = clock_()](PostgresTransaction& transaction) {
        return CommitRow(transaction, id, count, bytes, epoch, now_s);
      },
      Idempotent::kYes, std::move(done));
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
      Idempotent::kNo, std::move(done));
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
      Idempotent::kYes, std::move(done));
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
      Idempotent::kYes, std::move(done));
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
      Idempotent::kYes, std::move(done));
}

}  // namespace tissueform
