// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "absl/types/span.h"

#include "core/base/duration_histogram.h"

// The interface through which all stores use a database. It has two drivers: sqlite_database.h for
// one server, postgres_store/postgres_database.h for servers that share a database.
//
// A statement is written once, in PostgreSQL's dialect with parameters $1, $2, ...;
// sqlite_dialect.h translates it for SQLite.
namespace tissueform {

// A parameter for a column of bytes (bytea, BLOB).
struct SqlBytes {
  absl::string_view bytes = {};
};
// Text and bytes must outlive the call.
using SqlValue = std::variant<int64_t, absl::string_view, SqlBytes>;

// The result of a statement: rows and columns from 0.
class SqlRows {
 public:
  using Row = std::vector<std::string>;  // numbers as text; bytes as they are; NULL as empty

  SqlRows() = default;
  explicit SqlRows(std::vector<Row> rows) : rows_(std::move(rows)) {}

  size_t size() const { return rows_.size(); }
  bool empty() const { return rows_.empty(); }
  absl::string_view Text(size_t row, size_t column) const { return rows_[row][column]; }
  // 0 for text that is not a number.
  int64_t Integer(size_t row, size_t column) const;

 private:
  std::vector<Row> rows_;
};

// For `name = ANY (string_to_array($n, chr(31)))`. Names with a quotation mark, a backslash or a
// control character are left out: no id, SHA-256 or hexadecimal key has one.
template <typename Names>
std::string SqlNames(const Names& names);

// Statements that are committed together. One thread at a time.
class SqlTransaction {
 public:
  virtual ~SqlTransaction() = default;

  // One statement. Drivers may know `sql` by its address: a literal, or a text that stays for good.
  // After an error the transaction is lost: return it.
  virtual absl::StatusOr<SqlRows> Query(const char* sql, absl::Span<const SqlValue> values) = 0;
  absl::Status Run(const char* sql, absl::Span<const SqlValue> values) {
    return Query(sql, values).status();
  }

  // Blocks while another transaction that has called it with this number is open.
  virtual absl::Status TakeTurns(int64_t number) = 0;
  // All later reads of this transaction see one snapshot. Must be its first call; read-only.
  virtual absl::Status ReadOneMoment() = 0;
};

using SqlWork = std::function<absl::Status(SqlTransaction&)>;

struct SqlJob {
  // If it fails, nothing is stored. It may be called again after a failed commit, so each call must
  // set its outputs from the start.
  SqlWork work;
  // It only reads, so it need not wait for commits.
  bool reads = false;
  // Committing it twice has the effect of once, so a commit with an unknown outcome may be retried.
  bool repeatable = false;
  // Deleted data is gone from the database's files before the answer (docs/operations.md).
  bool erases = false;
  // Run gives up after 2 s where servers share the database; Submit ignores it.
  bool brief = false;
};

// A database, or this server's connections to it.
//
// A result is durable when it is returned. Errors: those of the work, and the driver's own
// (ResourceExhausted: the disk is full; Unavailable: the database is away). Thread-safe; must
// outlive its calls.
class SqlDatabase {
 public:
  using StatusCallback = std::function<void(absl::Status)>;

  virtual ~SqlDatabase() = default;

  // Blocks. Not from a StatusCallback.
  virtual absl::Status Run(const SqlJob& job) = 0;

  // Returns at once or soon. Jobs of one key run in the order of their calls. `done` is called
  // once, on any thread, without a lock held.
  virtual void Submit(const std::string& key, SqlJob job, StatusCallback done) = 0;
  // As Submit, but does not wait for earlier jobs, and gives up as a brief job does.
  virtual void Peek(const std::string& key, SqlJob job, StatusCallback done) = 0;

  // Whether other servers use it too.
  virtual bool shared() const = 0;
  // Time of each job from call to answer; null for a database in memory.
  virtual const DurationHistogram* latency() const = 0;
};

// Runs `work`, which only reads, and returns its result.
template <typename Result>
absl::StatusOr<Result> ReadSql(SqlDatabase* database,
                               const std::function<absl::StatusOr<Result>(SqlTransaction&)>& work) {
  absl::StatusOr<Result> result;
  const absl::Status status = database->Run({.work =
                                                 [&](SqlTransaction& transaction) {
                                                   result = work(transaction);
                                                   return result.status();
                                                 },
                                             .reads = true,
                                             .repeatable = true});
  return status.ok() ? std::move(result) : status;
}

// A job that passes the result of the last call of `work` to `done`.
template <typename Result>
std::pair<SqlWork, SqlDatabase::StatusCallback> Returning(
    std::function<absl::StatusOr<Result>(SqlTransaction&)> work,
    std::function<void(absl::StatusOr<Result>)> done) {
  auto result = std::make_shared<absl::StatusOr<Result>>();
  return {[result, work = std::move(work)](SqlTransaction& transaction) {
            *result = work(transaction);
            return result->status();
          },
          [result, done = std::move(done)](absl::Status status) {
            done(status.ok() ? *std::move(result) : std::move(status));
          }};
}

// One row more than the page holds shows whether another page follows.
inline int64_t RowsOfPage(int limit) { return int64_t{limit} + 1; }

// The records of a page. A damaged row is left out; reading it by name gives the error. Pages are
// ordered by `name_column`.
template <typename Page, typename Read>
Page ReadPage(const SqlRows& rows, int limit, size_t name_column, Read read) {
  Page page;
  for (size_t row = 0; row < rows.size(); ++row) {
    if (row == static_cast<size_t>(limit)) {
      page.next = std::string(rows.Text(row - 1, name_column));
      break;
    }
    auto record = read(rows, row);
    if (record.ok()) page.records.push_back(*std::move(record));
  }
  return page;
}

// Adds a name to a list of SqlNames.
void AddSqlName(absl::string_view name, std::string* list);

template <typename Names>
std::string SqlNames(const Names& names) {
  std::string list;
  for (const auto& name : names) AddSqlName(name, &list);
  return list;
}

}  // namespace tissueform
