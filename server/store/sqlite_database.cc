// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/sqlite_database.h"

#include <utility>
#include <variant>
#include <vector>

#include "core/base/status_macros.h"
#include "server/store/sqlite_dialect.h"

namespace tissueform {
namespace {

void Bind(const SqlValue& value, Database::Query* query) {
  if (const auto* number = std::get_if<int64_t>(&value)) {
    query->Bind(*number);
  } else if (const auto* text = std::get_if<absl::string_view>(&value)) {
    query->Bind(*text);
  } else {
    query->BindBytes(std::get<SqlBytes>(value).bytes);
  }
}

class SqliteTransaction final : public SqlTransaction {
 public:
  explicit SqliteTransaction(Database* database) : database_(*database) {}

  absl::StatusOr<SqlRows> Query(const char* sql, absl::Span<const SqlValue> values) override {
    Database::Query query = database_.Prepare(sql, ToSqlite);
    for (const SqlValue& value : values) Bind(value, &query);
    std::vector<SqlRows::Row> rows;
    for (;;) {
      TF_ASSIGN_OR_RETURN(const bool found, query.Step());
      if (!found) return SqlRows(std::move(rows));
      SqlRows::Row& row = rows.emplace_back();
      for (int column = 0; column < query.num_columns(); ++column) {
        row.emplace_back(query.Bytes(column));
      }
    }
  }
  absl::Status TakeTurns(int64_t /*number*/) override { return absl::OkStatus(); }
  absl::Status ReadOneMoment() override {
    return database_.in_transaction() ? absl::OkStatus() : database_.Execute("BEGIN");
  }

 private:
  Database& database_;
};

// Ends what ReadOneMoment has begun.
std::function<absl::Status(Database&)> ReadingOnSqlite(SqlWork work) {
  return [work = OnSqlite(std::move(work))](Database& database) {
    absl::Status status = work(database);
    if (database.in_transaction()) status.Update(database.Execute("COMMIT"));
    return status;
  };
}

}  // namespace

std::function<absl::Status(Database&)> OnSqlite(SqlWork work) {
  return [work = std::move(work)](Database& database) {
    SqliteTransaction transaction(&database);
    return work(transaction);
  };
}

SqliteDatabase::SqliteDatabase(std::unique_ptr<Database> database, std::unique_ptr<Database> reader,
                               std::function<absl::Status()> check)
    : thread_(std::move(database), std::move(reader), std::move(check)) {}

SqliteDatabase::SqliteDatabase(std::unique_ptr<Database> in_memory)
    : thread_(std::move(in_memory)) {}

SqliteDatabase::~SqliteDatabase() {
  MutexLock lock(mutex_);
  ending_ = true;  // callbacks of the commit thread, which ends last, must not use reads_ any more
}

absl::Status SqliteDatabase::Run(const SqlJob& job) {
  if (job.reads && !thread_.in_memory()) return thread_.Read(ReadingOnSqlite(job.work));
  return thread_.Run({.work = OnSqlite(job.work), .erases = job.erases});
}

void SqliteDatabase::Submit(const std::string& key, SqlJob job, StatusCallback done) {
  if (job.reads && SubmitRead(key, job, done)) return;
  SubmitWrite(key, std::move(job), std::move(done));
}

bool SqliteDatabase::SubmitRead(const std::string& key, const SqlJob& job,
                                const StatusCallback& done) {
  if (thread_.in_memory()) return false;
  MutexLock lock(mutex_);
  if (ending_ || written_.contains(key)) return false;
  reads_.Submit(key, [this, job, done] { done(Run(job)); });
  return true;
}

void SqliteDatabase::SubmitWrite(const std::string& key, SqlJob job, StatusCallback done) {
  {
    MutexLock lock(mutex_);
    ++written_[key];
  }
  thread_.Submit({.work = OnSqlite(std::move(job.work)),
                  .erases = job.erases,
                  .done = [this, key, done = std::move(done)](absl::Status status) {
                    {
                      MutexLock lock(mutex_);
                      if (--written_[key] == 0) written_.erase(key);
                    }
                    done(std::move(status));
                  }});
}

const DurationHistogram* SqliteDatabase::latency() const {
  return thread_.in_memory() ? nullptr : &thread_.latency();
}

}  // namespace tissueform
