// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

struct sqlite3;
struct sqlite3_stmt;

namespace tissueform {

// One connection to an SQLite database, and the only place that knows SQLite. One thread at a time.
//
// What is committed is on the disk (write-ahead log, synchronous=FULL), and what is deleted is
// overwritten (secure_delete).
//
// Errors of all: ResourceExhausted (the disk is full), FailedPrecondition (read-only), DataLoss
// (the file is damaged), Unavailable (another program holds it), or Internal; they name the file.
class Database {
 public:
  // A statement with its values, then its rows. Text and bytes that are bound must outlive it; what
  // it returns lives until the next Step. An error of Bind comes out of Step.
  class Query {
   public:
    ~Query();
    Query(Query&& other) noexcept;
    Query& operator=(Query&&) = delete;

    Query& Bind(int64_t value);
    Query& Bind(absl::string_view text);
    Query& BindBytes(absl::string_view bytes);

    // True when there is a row, false after the last.
    absl::StatusOr<bool> Step();
    // All steps, for a statement without rows.
    absl::Status Run();

    int num_columns() const;
    // Columns of the row, from 0.
    int64_t Integer(int column) const;
    absl::string_view Text(int column) const;
    absl::string_view Bytes(int column) const;
    // Binds the value of the column, of any type, to the next parameter of `other`.
    void CopyColumn(int column, Query* other) const;

   private:
    friend class Database;
    Query(const Database* database, sqlite3_stmt* statement)
        : database_(database), statement_(statement) {}

    const Database* database_;
    sqlite3_stmt* statement_;  // null: could not be prepared
    int bound_ = 0;
    int error_ = 0;
  };

  // Opens the database, or makes an empty one; sync its folder then.
  static absl::StatusOr<std::unique_ptr<Database>> Open(const std::string& path);
  // For reading a file that no process writes; creates no other file next to it. Errors: NotFound.
  static absl::StatusOr<std::unique_ptr<Database>> OpenForReading(const std::string& path);
  // One that goes with this object. TruncateLog does nothing: there is no log.
  static absl::StatusOr<std::unique_ptr<Database>> OpenInMemory();
  ~Database();
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  const std::string& path() const { return path_; }

  // Prepared once: `sql` is a literal, known by its address. REQUIRES: no Query of it is in use.
  Query Prepare(const char* sql) { return Prepare(sql, nullptr); }
  // The same in other words, which `translate` finds when it is prepared; null: it stays as it is.
  Query Prepare(const char* sql, std::string (*translate)(absl::string_view sql));
  // A statement without values and rows, or several.
  absl::Status Execute(const std::string& sql);

  bool in_transaction() const;
  // Rows changed so far; grows with every change.
  int64_t total_changes() const;

  // Writes the log into the database and empties it, so that nothing of what was deleted is left in
  // it; on the disk when it returns. False when a reader is in the way: try again later.
  absl::StatusOr<bool> TruncateLog();

 private:
  Database(std::string path, sqlite3* handle) : path_(std::move(path)), handle_(handle) {}

  static absl::StatusOr<std::unique_ptr<Database>> Open(const std::string& path, int flags,
                                                        const char* settings);
  absl::Status Error() const;

  const std::string path_;
  sqlite3* const handle_;
  std::map<const char*, sqlite3_stmt*> statements_;
};

}  // namespace tissueform
