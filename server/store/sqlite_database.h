// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "absl/status/status.h"

#include "core/base/mutex.h"
#include "server/platform/storage/database.h"
#include "server/store/commit_thread.h"
#include "server/store/ordered_jobs.h"
#include "server/store/sql_database.h"

namespace tissueform {

// The driver for SQLite. One thread writes, in call order, and commits waiting jobs together. Reads
// do not wait for it, except reads of a key with unfinished writes.
//
// Submit calls `done` on that thread or on the reading thread; in memory, before it returns.
class SqliteDatabase final : public SqlDatabase {
 public:
  // As CommitThread's.
  SqliteDatabase(std::unique_ptr<Database> database, std::unique_ptr<Database> reader,
                 std::function<absl::Status()> check);
  explicit SqliteDatabase(std::unique_ptr<Database> in_memory);
  // Finishes all submitted jobs, including those that their callbacks submit.
  ~SqliteDatabase() override;

  absl::Status Run(const SqlJob& job) override;
  void Submit(const std::string& key, SqlJob job, StatusCallback done) override;
  void Peek(const std::string& key, SqlJob job, StatusCallback done) override {
    Submit(key, std::move(job), std::move(done));
  }
  bool shared() const override { return false; }
  const DurationHistogram* latency() const override;

  CommitThread& thread() { return thread_; }

 private:
  // Runs it on the reading thread. False if it must wait for the commit thread.
  bool SubmitRead(const std::string& key, const SqlJob& job, const StatusCallback& done)
      ABSL_LOCKS_EXCLUDED(mutex_);
  void SubmitWrite(const std::string& key, SqlJob job, StatusCallback done);

  Mutex mutex_;
  // Number of unfinished writes by key.
  std::map<std::string, int> written_ ABSL_GUARDED_BY(mutex_);
  bool ending_ ABSL_GUARDED_BY(mutex_) = false;
  CommitThread thread_;
  OrderedJobs reads_{1};  // last: its jobs use the others
};

// Adapts SqlJob::work to a connection.
std::function<absl::Status(Database&)> OnSqlite(SqlWork work);

}  // namespace tissueform
