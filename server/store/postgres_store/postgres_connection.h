// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/store/postgres_store/postgres_options.h"
#include "server/store/sql_database.h"

namespace tissueform {

// How a transaction has ended.
enum class PostgresOutcome {
  kCommitted,
  kFailed,     // nothing of it is kept, and trying again would not help
  kTransient,  // nothing of it is kept; another try may do better
  kUnknown,    // the connection was lost while it was committed
};

class PostgresTransaction : public SqlTransaction {
 public:
  // Statements without parameters and rows.
  virtual absl::Status Execute(const std::string& sql) = 0;

  absl::Status TakeTurns(int64_t number) override {
    return Run("SELECT pg_advisory_xact_lock($1)", {number});
  }
  absl::Status ReadOneMoment() override {
    return Execute("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ, READ ONLY");
  }
};

// One connection to a PostgreSQL database, and the only place that knows libpqxx. One thread at a
// time, but for GiveUp.
//
// Errors of all: ResourceExhausted (the database's disk is full), InvalidArgument (text that is no
// UTF-8), Unavailable (not there; it ends a statement that takes too long; it has become a
// read-only replica), or Internal; of Open also FailedPrecondition (a read-only replica; the
// password is refused). They name the database and no value.
class PostgresConnection {
 public:
  static absl::StatusOr<std::unique_ptr<PostgresConnection>> Open(const PostgresTarget& target);
  ~PostgresConnection();
  PostgresConnection(const PostgresConnection&) = delete;
  PostgresConnection& operator=(const PostgresConnection&) = delete;

  // Runs `work` in a transaction, which is committed when it is OK.
  absl::Status Transact(const std::function<absl::Status(PostgresTransaction&)>& work,
                        PostgresOutcome* outcome);

  // Any thread: where a statement (also one that begins or ends a transaction, or listens) has
  // waited for its answer for so long its connection is cut, and it fails as one whose connection
  // was lost.
  void GiveUp(std::chrono::milliseconds unanswered);

  // False when it is no longer usable.
  bool usable() const { return usable_; }

  // From now on WaitForNotices returns the notices of this channel. Once.
  absl::Status Listen(const std::string& channel);
  // The notices that have come, in order; empty after `most` without.
  absl::StatusOr<std::vector<std::string>> WaitForNotices(std::chrono::milliseconds most);

 private:
  struct Library;
  explicit PostgresConnection(std::unique_ptr<Library> library);

  const std::unique_ptr<Library> library_;
  bool usable_ = true;
};

}  // namespace tissueform
