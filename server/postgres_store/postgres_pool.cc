// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/postgres_store/postgres_pool.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

// Between tries; doubled every time.
constexpr std::chrono::milliseconds kFirstPause{20};
constexpr std::chrono::milliseconds kLongestPause{1000};
constexpr std::chrono::milliseconds kShortestWatch{10};

absl::Status CheckDatabase(const std::string& name, PostgresTransaction& transaction) {
  TF_ASSIGN_OR_RETURN(
      const PostgresRows rows,
      transaction.Query("SELECT pg_is_in_recovery()::text, current_setting('server_encoding'), "
                        "current_setting('synchronous_commit')",
                        {}));
  const auto refused = [&](const char* why) {
    return absl::FailedPreconditionError(absl::StrCat("database ", name, ": ", why));
  };
  if (rows.Text(0, 0) == "true") {
    return refused("it is a read-only replica; name the primary (target_session_attrs)");
  }
  if (rows.Text(0, 1) != "UTF8") return refused("its encoding is not UTF8; make one that is");
  if (rows.Text(0, 2) == "off") {
    return refused(
        "it answers before it has written (synchronous_commit=off), so that what is acknowledged "
        "may be lost; set it to on");
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::unique_ptr<PostgresPool>> PostgresPool::Open(const PostgresOptions& options) {
  TF_ASSIGN_OR_RETURN(PostgresTarget target, TargetOf(options));
  TF_ASSIGN_OR_RETURN(std::unique_ptr<PostgresConnection> connection,
                      PostgresConnection::Open(target));
  PostgresOutcome outcome = PostgresOutcome::kFailed;
  TF_RETURN_IF_ERROR(connection->Transact(
      [&](PostgresTransaction& transaction) { return CheckDatabase(target.name, transaction); },
      &outcome));
  std::unique_ptr<PostgresPool> pool(new PostgresPool(options, std::move(target)));
  MutexLock lock(pool->mutex_);
  pool->idle_.push_back(std::move(connection));
  return pool;
}

PostgresPool::~PostgresPool() {
  {
    MutexLock lock(mutex_);
    ending_ = true;
    changed_.NotifyAll();
    while (in_use_ > 0) changed_.Wait(mutex_);
  }
  watch_.join();
}

absl::Status PostgresPool::Run(const Work& work, Clock::time_point deadline) {
  const Clock::time_point begin = Clock::now();
  absl::Status status = TryUntil(work, deadline);
  latency_.Observe(Clock::now() - begin);
  return status;
}

absl::Status PostgresPool::TryUntil(const Work& work, Clock::time_point deadline) {
  // Of what has waited behind others for too long.
  if (Clock::now() >= deadline) {
    return absl::UnavailableError(
        absl::StrCat("database ", target_.name, ": it did not answer in time; try again later"));
  }
  for (std::chrono::milliseconds pause = kFirstPause;; pause = std::min(2 * pause, kLongestPause)) {
    PostgresOutcome outcome = PostgresOutcome::kFailed;
    absl::Status status = Try(work, deadline, &outcome);
    if (outcome != PostgresOutcome::kTransient || Clock::now() + pause > deadline ||
        !Pause(pause)) {
      return status;
    }
  }
}

absl::Status PostgresPool::Try(const Work& work, Clock::time_point deadline,
                               PostgresOutcome* outcome) {
  absl::StatusOr<std::unique_ptr<PostgresConnection>> taken = Take(deadline);
  if (!taken.ok()) return taken.status();
  std::unique_ptr<PostgresConnection> connection = *std::move(taken);
  absl::Status status;
  if (connection == nullptr) {
    absl::StatusOr<std::unique_ptr<PostgresConnection>> opened = PostgresConnection::Open(target_);
    if (opened.ok()) {
      connection = *std::move(opened);
    } else {
      // A password that is changed while the server runs is no fault of who calls.
      status = absl::UnavailableError(opened.status().message());
      *outcome = PostgresOutcome::kTransient;
    }
  }
  if (connection != nullptr) {
    {
      MutexLock lock(mutex_);
      busy_.insert(connection.get());
    }
    status = connection->Transact(work, outcome);
  }
  GiveBack(std::move(connection));
  return status;
}

absl::StatusOr<std::unique_ptr<PostgresConnection>> PostgresPool::Take(Clock::time_point deadline) {
  MutexLock lock(mutex_);
  while (!ending_ && in_use_ >= options_.max_connections) {
    if (!changed_.WaitUntil(mutex_, deadline) && in_use_ >= options_.max_connections) {
      return absl::UnavailableError(
          absl::StrCat("database ", target_.name, ": all ", options_.max_connections,
                       " connections were in use for too long; try again later"));
    }
  }
  if (ending_) return absl::UnavailableError("the store is being closed");
  ++in_use_;
  if (idle_.empty()) return nullptr;
  std::unique_ptr<PostgresConnection> connection = std::move(idle_.back());
  idle_.pop_back();
  return connection;
}

void PostgresPool::GiveBack(std::unique_ptr<PostgresConnection> connection) {
  MutexLock lock(mutex_);
  --in_use_;
  busy_.erase(connection.get());
  if (connection != nullptr && connection->usable()) idle_.push_back(std::move(connection));
  changed_.NotifyAll();
}

void PostgresPool::Watch() {
  const std::chrono::milliseconds often =
      std::clamp(options_.unanswered_timeout / 4, kShortestWatch, kLongestPause);
  MutexLock lock(mutex_);
  // To the last call's end: that may be what is not answered.
  while (!ending_ || in_use_ > 0) {
    changed_.WaitUntil(mutex_, Clock::now() + often);
    for (PostgresConnection* connection : busy_) connection->GiveUp(options_.unanswered_timeout);
  }
}

bool PostgresPool::Pause(std::chrono::milliseconds pause) {
  const Clock::time_point end = Clock::now() + pause;
  MutexLock lock(mutex_);
  while (!ending_ && Clock::now() < end) changed_.WaitUntil(mutex_, end);
  return !ending_;
}

}  // namespace tissueform
