// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/duration_histogram.h"
#include "core/base/mutex.h"
#include "server/store/postgres_store/postgres_connection.h"

namespace tissueform {

// A few connections to one database, made when they are needed.
//
// Thread-safe; must outlive its calls.
class PostgresPool {
 public:
  using Clock = std::chrono::steady_clock;
  // Reads and writes rows. Called again when another try may do better, so what it leaves outside
  // the database must be what its last call left.
  using Work = std::function<absl::Status(PostgresTransaction&)>;
  // Whether a second commit of the same work changes nothing.
  enum class Idempotent { kYes, kNo };

  // Connects once, so that what an operator must change is reported at the start: errors are those
  // of TargetOf and PostgresConnection; FailedPrecondition when the database is a read-only
  // replica, holds text that is not UTF-8, or answers before it has written (synchronous_commit).
  static absl::StatusOr<std::unique_ptr<PostgresPool>> Open(const PostgresOptions& options);
  // Calls that wait are answered UNAVAILABLE.
  ~PostgresPool();

  // Runs `work` in a transaction. A database that is not there is tried again until `deadline`. A
  // commit with an unknown outcome is tried again only where the work is idempotent.
  //
  // A database that says nothing at all costs kMaxLate more; one that falls silent within a
  // statement at most kLeastAnswer.
  //
  // Errors: what `work` says, those of PostgresConnection, and Unavailable (all connections are in
  // use until then; the database is not there until then, for any reason). Those of the
  // database are logged, and have a sentence for clients (store_errors.h).
  absl::Status Run(const Work& work, Idempotent idempotent = Idempotent::kNo) {
    return Run(work, Clock::now() + Patience(), idempotent);
  }
  absl::Status Run(const Work& work, Clock::time_point deadline,
                   Idempotent idempotent = Idempotent::kNo);

  static constexpr std::chrono::milliseconds kMaxLate{1'000};
  static constexpr std::chrono::milliseconds kLeastAnswer{5'000};

  // No call waits for the database beyond this time: the server ends.
  void EndWaiting(Clock::time_point by);

  const PostgresOptions& options() const { return options_; }
  const PostgresTarget& target() const { return target_; }
  // Of each call of Run.
  const DurationHistogram& latency() const { return latency_; }

 private:
  PostgresPool(PostgresOptions options, PostgresTarget target)
      : options_(std::move(options)), target_(std::move(target)), watch_([this] { Watch(); }) {}

  // What is left of the options' for this thread's call while the database is away: a queue or a
  // job that was slow uses nothing up.
  Clock::duration Patience();
  absl::Status TryUntil(const Work& work, Clock::time_point deadline, Idempotent idempotent);
  absl::Status Try(const Work& work, Clock::time_point deadline, PostgresOutcome* outcome);
  // A place, with a connection or none.
  absl::StatusOr<std::unique_ptr<PostgresConnection>> Take(Clock::time_point deadline);
  void GiveBack(std::unique_ptr<PostgresConnection> connection, PostgresOutcome outcome);
  absl::StatusOr<std::unique_ptr<PostgresConnection>> Connect(Clock::time_point deadline) const;
  // Gives up connections that are not answered.
  void Watch();
  // Before another try, after one that began then. False when there is no time for it.
  bool Pause(std::chrono::milliseconds pause, Clock::time_point tried, Clock::time_point deadline);
  void LogFailure(const absl::Status& failure);

  const PostgresOptions options_;
  const PostgresTarget target_;
  DurationHistogram latency_;

  Mutex mutex_;
  ConditionVariable changed_;
  std::vector<std::unique_ptr<PostgresConnection>> idle_ ABSL_GUARDED_BY(mutex_);
  // With the deadlines of those who use them.
  std::map<PostgresConnection*, Clock::time_point> busy_ ABSL_GUARDED_BY(mutex_);
  int in_use_ ABSL_GUARDED_BY(mutex_) = 0;
  bool ending_ ABSL_GUARDED_BY(mutex_) = false;
  Clock::time_point latest_ ABSL_GUARDED_BY(mutex_) = Clock::time_point::max();
  // When a transaction was last committed, and when one failed that another try may help.
  Clock::time_point answered_ ABSL_GUARDED_BY(mutex_);
  Clock::time_point failed_ ABSL_GUARDED_BY(mutex_);
  Clock::time_point logged_ ABSL_GUARDED_BY(mutex_);

  std::thread watch_;  // last: it uses the others
};

}  // namespace tissueform
