// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/durable_session_store.h"

#include <algorithm>
#include <functional>
#include <memory>

#include "core/base/random_id.h"
#include "core/base/status_macros.h"
#include "server/store/store_errors.h"
#include "server/store/store_rows.h"

namespace tissueform {
namespace {

// Random, so that an etag never comes again, without a counter that every write would have to keep.
std::string NewEtag() { return RandomId(); }

// What decides about a write.
struct State {
  int64_t key = 0;
  std::string etag;
  int64_t epoch = 0;
  int64_t handles = 0;
  int64_t created_s = 0;
  int64_t last_used_s = 0;
};

absl::StatusOr<State> FindState(Database& database, const std::string& id) {
  Database::Query query = database.Prepare(
      "SELECT session_states.key, etag, epoch, handles, created_s, last_used_s FROM sessions JOIN "
      "session_states ON session_states.key = sessions.key WHERE id = ?");
  TF_ASSIGN_OR_RETURN(const bool found, query.Bind(id).Step());
  if (!found) return NoSession(id);
  return State{query.Integer(0), std::string(query.Text(1)), query.Integer(2),
               query.Integer(3), query.Integer(4),           query.Integer(5)};
}

// The bytes of the two rows. Poses have a row of their own.
struct Bytes {
  explicit Bytes(SessionRecord session) : poses(Seal(SerializePoses(session.last_poses))) {
    session.last_poses.clear();
    record = Seal(SerializeRecord(session));
  }

  std::string record;
  std::string poses;
};

absl::Status Insert(Database& database, const SessionRecord& record) {
  const Bytes bytes(record);
  TF_RETURN_IF_ERROR(database.Prepare("INSERT INTO sessions (id, owner, record) VALUES (?, ?, ?)")
                         .Bind(record.id)
                         .Bind(record.owner)
                         .BindBytes(bytes.record)
                         .Run());
  return database
      .Prepare(
          "INSERT INTO session_states (key, etag, epoch, handles, poses, created_s, "
          "last_used_s) VALUES (last_insert_rowid(), ?, ?, ?, ?, ?, ?)")
      .Bind(record.etag)
      .Bind(record.epoch)
      .Bind(static_cast<int64_t>(record.handles.size()))
      .BindBytes(bytes.poses)
      .Bind(record.created_s)
      .Bind(record.last_used_s)
      .Run();
}

absl::Status Replace(Database& database, int64_t key, const SessionRecord& record) {
  const Bytes bytes(record);
  TF_RETURN_IF_ERROR(database.Prepare("UPDATE sessions SET owner = ?, record = ? WHERE key = ?")
                         .Bind(record.owner)
                         .BindBytes(bytes.record)
                         .Bind(key)
                         .Run());
  return database
      .Prepare(
          "UPDATE session_states SET etag = ?, epoch = ?, handles = ?, poses = ?, "
          "last_used_s = ? WHERE key = ?")
      .Bind(record.etag)
      .Bind(record.epoch)
      .Bind(static_cast<int64_t>(record.handles.size()))
      .BindBytes(bytes.poses)
      .Bind(record.last_used_s)
      .Bind(key)
      .Run();
}

// Rows until there are more than `limit`. A damaged one is left out: Get says what it is.
absl::StatusOr<SessionStore::Page> ReadPage(Database::Query* query, int limit) {
  SessionStore::Page page;
  for (;;) {
    TF_ASSIGN_OR_RETURN(const bool row, query->Step());
    if (!row) return page;
    absl::StatusOr<SessionRecord> record = ReadSession(*query);
    if (!record.ok()) continue;
    if (page.records.size() == static_cast<size_t>(limit)) {
      page.next = page.records.back().id;
      return page;
    }
    page.records.push_back(*std::move(record));
  }
}

}  // namespace

template <typename Result>
void DurableSessionStore::Submit(std::function<absl::StatusOr<Result>(Database&)> work,
                                 std::function<void(absl::StatusOr<Result>)> done) {
  auto result = std::make_shared<absl::StatusOr<Result>>();
  thread_->Submit({.work =
                       [result, work = std::move(work)](Database& database) {
                         *result = work(database);
                         return result->status();
                       },
                   .done =
                       [result, done = std::move(done)](absl::Status status) {
                         done(status.ok() ? *std::move(result) : std::move(status));
                       }});
}

void DurableSessionStore::Create(SessionRecord record, int64_t epoch, RecordCallback done) {
  if (record.id.empty()) {
    done(absl::InvalidArgumentError("a session record needs an id"));
    return;
  }
  record.epoch = epoch;
  record.etag = NewEtag();
  record.created_s = clock_();
  record.last_used_s = record.created_s;
  Submit<SessionRecord>(
      [record = std::move(record)](Database& database) -> absl::StatusOr<SessionRecord> {
        if (FindState(database, record.id).ok()) return SessionExists(record.id);
        TF_RETURN_IF_ERROR(Insert(database, record));
        return record;
      },
      std::move(done));
}

void DurableSessionStore::Get(const std::string& id, RecordCallback done) {
  Submit<SessionRecord>(
      [id](Database& database) -> absl::StatusOr<SessionRecord> {
        Database::Query query = database.Prepare(TF_SELECT_SESSIONS "WHERE id = ?");
        TF_ASSIGN_OR_RETURN(const bool found, query.Bind(id).Step());
        if (!found) return NoSession(id);
        return ReadSession(query);
      },
      std::move(done));
}

void DurableSessionStore::Update(SessionRecord record, int64_t epoch, RecordCallback done) {
  Submit<SessionRecord>(
      [record = std::move(record), epoch,
       now_s = clock_()](Database& database) -> absl::StatusOr<SessionRecord> {
        TF_ASSIGN_OR_RETURN(const State state, FindState(database, record.id));
        // A record without an etag was not read from here.
        TF_RETURN_IF_ERROR(CheckSessionWrite(record.id, record.etag.empty() ? "none" : record.etag,
                                             epoch, state.etag, state.epoch));
        SessionRecord next = record;
        next.etag = NewEtag();
        next.epoch = epoch;
        next.created_s = state.created_s;
        next.last_used_s = std::max(state.last_used_s, now_s);
        TF_RETURN_IF_ERROR(Replace(database, state.key, next));
        return next;
      },
      std::move(done));
}

void DurableSessionStore::CommitPoses(const std::string& id, std::vector<HandlePose> poses,
                                      int64_t epoch, StatusCallback done) {
  thread_->Submit(
      {.work = [id, count = poses.size(), bytes = Seal(SerializePoses(poses)), epoch,
                now_s = clock_()](Database& database) -> absl::Status {
         TF_ASSIGN_OR_RETURN(const State state, FindState(database, id));
         TF_RETURN_IF_ERROR(CheckSessionWrite(id, "", epoch, state.etag, state.epoch));
         TF_RETURN_IF_ERROR(CheckPoseCount(id, count, static_cast<size_t>(state.handles)));
         return database
             .Prepare(
                 "UPDATE session_states SET poses = ?, epoch = ?, last_used_s = ? WHERE key = ?")
             .BindBytes(bytes)
             .Bind(epoch)
             .Bind(std::max(state.last_used_s, now_s))
             .Bind(state.key)
             .Run();
       },
       .done = std::move(done)});
}

void DurableSessionStore::Delete(const std::string& id, const std::string& etag, int64_t epoch,
                                 StatusCallback done) {
  thread_->Submit(
      {.work = [id, etag, epoch](Database& database) -> absl::Status {
         TF_ASSIGN_OR_RETURN(const State state, FindState(database, id));
         TF_RETURN_IF_ERROR(CheckSessionWrite(id, etag, epoch, state.etag, state.epoch));
         return database.Prepare("DELETE FROM sessions WHERE key = ?").Bind(state.key).Run();
       },
       .erases = true,
       .done = std::move(done)});
}

void DurableSessionStore::List(const ListRequest& request, PageCallback done) {
  if (request.limit < 1) {
    done(BadLimit(request.limit));
    return;
  }
  Submit<Page>(
      [request](Database& database) {
        Database::Query query =
            database.Prepare(TF_SELECT_SESSIONS
                             "WHERE id > ? AND (? OR owner = ? OR id IN (SELECT value FROM "
                             "json_each(?))) ORDER BY id");
        query.Bind(request.after);
        query.Bind(int64_t{!request.owner.has_value()});
        const std::string owner = request.owner.value_or("");
        query.Bind(owner);
        const std::string also = NamesInJson(request.also);
        query.Bind(also);
        return ReadPage(&query, request.limit);
      },
      std::move(done));
}

void DurableSessionStore::Touch(std::vector<std::string> ids, int64_t now_s, StatusCallback done) {
  thread_->Submit({.work = [ids = std::move(ids), now_s](Database& database) -> absl::Status {
                     for (const std::string& id : ids) {
                       TF_RETURN_IF_ERROR(
                           database
                               .Prepare("UPDATE session_states SET last_used_s = max(last_used_s, "
                                        "?) WHERE key = (SELECT key FROM sessions WHERE id = ?)")
                               .Bind(now_s)
                               .Bind(id)
                               .Run());
                     }
                     return absl::OkStatus();
                   },
                   .done = std::move(done)});
}

void DurableSessionStore::ListUnused(int64_t before_s, int limit, PageCallback done) {
  if (limit < 1) {
    done(BadLimit(limit));
    return;
  }
  Submit<Page>(
      [before_s, limit](Database& database) -> absl::StatusOr<Page> {
        Database::Query query = database.Prepare(
            TF_SELECT_SESSIONS "WHERE last_used_s < ? ORDER BY last_used_s, id LIMIT ?");
        query.Bind(before_s).Bind(int64_t{limit});
        return ReadPage(&query, limit);
      },
      std::move(done));
}

}  // namespace tissueform
