// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "server/store/postgres_store/ordered_jobs.h"
#include "server/store/postgres_store/postgres_pool.h"
#include "server/store/session_store.h"

namespace tissueform {

// Session records in a PostgreSQL database that several servers share. What is asked of one session
// is done in the order of the calls; answers come on this store's threads. A call is answered after
// PostgresOptions::patience at the latest, UNAVAILABLE where the database was not there; Peek,
// which has threads of its own, after 2 s.
//
// The epoch that a write is refused by is that of the session's lease (session_leases.h): a server
// that takes a session over raises it, so nobody who held it before writes any more. Nobody has a
// higher one than the row's, so "not older" is "mine".
class PostgresSessionStore final : public SessionStore {
 public:
  // `pool` must outlive it.
  PostgresSessionStore(PostgresPool* pool, UnixClock clock);

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
  using Idempotent = PostgresPool::Idempotent;

  void Submit(const std::string& key, PostgresPool::Work work, Idempotent idempotent,
              StatusCallback done);
  template <typename Result>
  void Ask(const std::string& key, std::function<absl::StatusOr<Result>(PostgresTransaction&)> work,
           Idempotent idempotent, std::function<void(absl::StatusOr<Result>)> done);

  PostgresPool* const pool_;
  const UnixClock clock_;
  // Last: their jobs use the others.
  OrderedJobs jobs_;
  OrderedJobs peeks_;
};

}  // namespace tissueform
