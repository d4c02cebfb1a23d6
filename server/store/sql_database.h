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

// The one way in which the stores use a database. Two drivers implement it: sqlite_database.h for
// one server, postgres_store/postgres_database.h for several that share what they keep.
//
// A statement is written once, in PostgreSQL's words with parameters $1, $2, ...; sqlite_dialect.h
// lists what SQLite calls differently.
namespace tissueform {

// A parameter that a column of bytes is compared with or set to.
struct SqlBytes {
  absl::string_view bytes = {};
};
// Text and bytes must outlive the call.
using SqlValue = std::variant<int64_t, absl::string_view, SqlBytes>;

// What a statement has answered: rows and columns from 0.
class SqlRows {
 public:
  using Row = std::vector<std::string>;  // numbers as text; bytes as they are; NULL as nothing

  SqlRows() = default;
  explicit SqlRows(std::vector<Row> rows) : rows_(std::move(rows)) {}

  size_t size() const { return rows_.size(); }
  bool empty() const { return rows_.empty(); }
  absl::string_view Text(size_t row, size_t column) const { return rows_[row][column]; }
  // 0 for what is no number.
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

  // Until this transaction's end nobody else gets past a call with this number.
  virtual absl::Status TakeTurns(int64_t number) = 0;
  // What is read from here on is of one moment. First of all in a transaction that only reads.
  virtual absl::Status ReadOneMoment() = 0;
};

using SqlWork = std::function<absl::Status(SqlTransaction&)>;

struct SqlJob {
  // Nothing of it stays when it fails. It may be called again after a commit that failed, so what
  // it leaves outside the database must be what its last call left.
  SqlWork work;
  // It changes nothing: it need not wait for what is being committed.
  bool reads = false;
  // A second commit changes nothing, so that one with an unknown outcome may be tried again.
  bool repeatable = false;
  // What it deletes has left the files of the database when it is answered (docs/operations.md).
  bool erases = false;
};

// A database, or this server's connections to it.
//
// What was answered is as durable as the database. Errors: what the work says, and the driver's own
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
  // As Submit, but behind nothing that was submitted before, and for 2 s at most.
  virtual void Peek(const std::string& key, SqlJob job, StatusCallback done) = 0;

  // Whether other servers use it, too.
  virtual bool shared() const = 0;
  // Of each job, from its call to its answer; null where nothing is kept.
  virtual const DurationHistogram* latency() const = 0;
};

// What `work` finds in rows.
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

// A job whose answer is what the last call of `work` has returned.
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

// How many rows of a page are asked for, so that it is known whether there are more.
inline int64_t RowsOfPage(int limit) { return int64_t{limit} + 1; }

// The records of a page. A damaged row is left out: who asks for it hears so. `name_column` is that
// by which pages follow each other.
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
