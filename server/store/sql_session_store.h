// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "server/store/session_store.h"
#include "server/store/sql_database.h"

namespace tissueform {

// Sessions as rows (store_schema.h). Calls for one session are carried out in order.
//
// Where servers share the database, a write is checked against the epoch of the session's lease
// (postgres_store/session_leases.h). A server that takes a session over raises it, so writes of the
// previous holder are refused. No server has a higher epoch than the row, so "not older" means
// "mine".
class SqlSessionStore : public SessionStore {
 public:
  // `database` must outlive it.
  SqlSessionStore(SqlDatabase* database, UnixClock clock)
      : database_(database), clock_(std::move(clock)) {}

  void Create(SessionRecord record, int64_t epoch, RecordCallback done) override;
  void Get(const std::string& id, RecordCallback done) override;
  void Peek(const std::string& id, RecordCallback done) override;
  void Update(SessionRecord record, int64_t epoch, RecordCallback done) override;
  void CommitPoses(const std::string& id, std::vector<HandlePose> poses, int64_t epoch,
                   StatusCallback done) override;
  void Delete(const std::string& id, const std::string& etag, int64_t epoch,
              StatusCallback done) override;
  void List(const ListRequest& request, PageCallback done) override;
  void Touch(std::vector<std::string> ids, int64_t now_s, StatusCallback done) override;
  void ListUnused(int64_t before_s, int limit, PageCallback done) override;

 private:
  SqlDatabase* const database_;
  const UnixClock clock_;
};

// Stores `count` sealed poses as CommitPoses does, normally in one statement; others find the
// reason if that is refused.
absl::Status CommitPoseRow(SqlTransaction& transaction, const std::string& id, int64_t count,
                           const std::string& poses, int64_t epoch, int64_t now_s);

}  // namespace tissueform
