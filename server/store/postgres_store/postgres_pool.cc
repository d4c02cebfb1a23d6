// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/postgres_pool.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "spdlog/spdlog.h"

#include "core/base/status_macros.h"
#include "server/store/store_errors.h"

namespace tissueform {
namespace {

// Between tries; doubled every time.
constexpr std::chrono::milliseconds kFirstPause{20};
constexpr std::chrono::milliseconds kLongestPause{1000};
constexpr std::chrono::milliseconds kShortestWatch{10};
constexpr std::chrono::milliseconds kLongestWatch{250};
// Between lines of the log about the same.
constexpr std::chrono::seconds kBetweenLines{10};
// libpq takes less for this.
constexpr int64_t kLeastConnectSeconds = 2;

absl::Status CheckDatabase(const std::string& name, PostgresTransaction& transaction) {
  TF_ASSIGN_OR_RETURN(
      const SqlRows rows,
      transaction.Query("SELECT pg_is_in_recovery()::text, current_setting('server_encoding'), "
                        "current_setting('synchronous_commit')",
                        {}));
  const auto refused = [&](const char* why) {
    return absl::FailedPreconditionError(absl::StrCat("database ", name, ": ", why));
  };
  // Where the address has chosen one by its target_session_attrs.
  if (rows.Text(0, 0) == "true") {
    return refused("it is a read-only replica; use the primary (target_session_attrs)");
  }
  if (rows.Text(0, 1) != "UTF8") return refused("its encoding is not UTF8; create one with UTF8");
  if (rows.Text(0, 2) == "off") {
    return refused(
        "it answers before it writes (synchronous_commit=off), so that acknowledged data "
        "may be lost; set it to on");
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::unique_ptr<PostgresPool>> PostgresPool::Open(const PostgresOptions& options) {
  TF_ASSIGN_OR_RETURN(PostgresTarget target, TargetOf(options));
  TF_ASSIGN_OR_RETURN(std::unique_ptr<PostgresConnection> connection,
                      PostgresConnection::Open(target));
  std::unique_ptr<PostgresPool> pool(new PostgresPool(options, std::move(target)));
  {
    MutexLock lock(pool->mutex_);
    pool->idle_.push_back(std::move(connection));
  }
  PostgresOutcome outcome = PostgresOutcome::kFailed;
  TF_RETURN_IF_ERROR(pool->Try(
      [&](PostgresTransaction& transaction) {
        return CheckDatabase(pool->target().name, transaction);
      },
      Clock::now() + options.patience, &outcome));
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

PostgresPool::Clock::duration PostgresPool::Patience() {
  if (!options_.waited) return options_.patience;
  const Clock::duration left = options_.patience - options_.waited();
  MutexLock lock(mutex_);
  if (failed_ <= answered_) return options_.patience;
  // No call may have asked since: then one try.
  return Clock::now() - failed_ < kLeastAnswer ? left : std::max<Clock::duration>(left, kMaxLate);
}

absl::Status PostgresPool::Run(const Work& work, Clock::time_point deadline,
                               Idempotent idempotent) {
  const Clock::time_point begin = Clock::now();
  absl::Status status = TryUntil(work, deadline, idempotent);
  latency_.Observe(Clock::now() - begin);
  if (HasClientMessage(status)) LogFailure(status);
  return status;
}

void PostgresPool::LogFailure(const absl::Status& failure) {
  {
    MutexLock lock(mutex_);
    if (Clock::now() < logged_ + kBetweenLines) return;
    logged_ = Clock::now();
  }
  spdlog::warn("{}", std::string(failure.message()));
}

absl::Status PostgresPool::TryUntil(const Work& work, Clock::time_point deadline,
                                    Idempotent idempotent) {
  {
    MutexLock lock(mutex_);
    deadline = std::min(deadline, latest_);
  }
  // Of what has waited behind others for too long.
  if (Clock::now() >= deadline) {
    return HidingDatabase(absl::UnavailableError(
        absl::StrCat("database ", target_.name, ": it did not answer in time; try again later")));
  }
  absl::Status lost;  // of a commit that may have been kept; later failures do not change that
  for (std::chrono::milliseconds pause = kFirstPause;; pause = std::min(2 * pause, kLongestPause)) {
    const Clock::time_point tried = Clock::now();
    PostgresOutcome outcome = PostgresOutcome::kFailed;
    absl::Status status = Try(work, deadline, &outcome);
    const bool unknown = outcome == PostgresOutcome::kUnknown;
    if (unknown) lost.Update(status);
    const bool again =
        outcome == PostgresOutcome::kTransient || (unknown && idempotent == Idempotent::kYes);
    if (!again) return status;
    if (!Pause(pause, tried, deadline)) return lost.ok() ? status : lost;
  }
}

absl::Status PostgresPool::Try(const Work& work, Clock::time_point deadline,
                               PostgresOutcome* outcome) {
  absl::StatusOr<std::unique_ptr<PostgresConnection>> taken = Take(deadline);
  if (!taken.ok()) return taken.status();
  std::unique_ptr<PostgresConnection> connection = *std::move(taken);
  absl::Status status;
  if (connection == nullptr) {
    absl::StatusOr<std::unique_ptr<PostgresConnection>> opened = Connect(deadline);
    if (opened.ok()) {
      connection = *std::move(opened);
    } else {
      // A password that is changed while the server runs is no fault of who calls.
      status = HidingDatabase(absl::UnavailableError(opened.status().message()));
      *outcome = PostgresOutcome::kTransient;
    }
  }
  if (connection != nullptr) {
    {
      MutexLock lock(mutex_);
      busy_[connection.get()] = deadline;
    }
    status = connection->Transact(work, outcome);
  }
  GiveBack(std::move(connection), *outcome);
  return status;
}

absl::StatusOr<std::unique_ptr<PostgresConnection>> PostgresPool::Connect(
    Clock::time_point deadline) const {
  const auto left = std::chrono::ceil<std::chrono::seconds>(deadline - Clock::now());
  const int64_t most = std::max<int64_t>(options_.connect_timeout.count(), kLeastConnectSeconds);
  PostgresTarget target = target_;
  // Of a keyword that is there twice the last one counts.
  absl::StrAppend(&target.connection, "connect_timeout=",
                  std::clamp<int64_t>(left.count(), kLeastConnectSeconds, most));
  return PostgresConnection::Open(target);
}

absl::StatusOr<std::unique_ptr<PostgresConnection>> PostgresPool::Take(Clock::time_point deadline) {
  MutexLock lock(mutex_);
  while (!ending_ && in_use_ >= options_.max_connections) {
    const Clock::time_point until = std::min(deadline, latest_);
    if (changed_.WaitUntil(mutex_, until) || Clock::now() < until) continue;
    if (in_use_ < options_.max_connections) break;
    return HidingDatabase(absl::UnavailableError(
        absl::StrCat("database ", target_.name, ": all ", options_.max_connections,
                     " connections were in use for too long; try again later")));
  }
  if (ending_) return absl::UnavailableError("the store is being closed");
  ++in_use_;
  if (idle_.empty()) return nullptr;
  std::unique_ptr<PostgresConnection> connection = std::move(idle_.back());
  idle_.pop_back();
  return connection;
}

void PostgresPool::GiveBack(std::unique_ptr<PostgresConnection> connection,
                            PostgresOutcome outcome) {
  std::vector<std::unique_ptr<PostgresConnection>> suspects;
  MutexLock lock(mutex_);
  --in_use_;
  busy_.erase(connection.get());
  if (outcome == PostgresOutcome::kCommitted) answered_ = Clock::now();
  if (outcome == PostgresOutcome::kTransient) failed_ = Clock::now();
  if (connection != nullptr && connection->usable()) {
    idle_.push_back(std::move(connection));
  } else if (connection != nullptr) {
    // The others are lost for the same reason: a call that took one would wait once more.
    suspects.swap(idle_);
  }
  changed_.NotifyAll();
}

void PostgresPool::EndWaiting(Clock::time_point by) {
  MutexLock lock(mutex_);
  latest_ = by;
  changed_.NotifyAll();
}

void PostgresPool::Watch() {
  const std::chrono::milliseconds often =
      std::clamp(options_.unanswered_timeout / 4, kShortestWatch, kLongestWatch);
  MutexLock lock(mutex_);
  // To the last call's end: that may be what is not answered.
  while (!ending_ || in_use_ > 0) {
    changed_.WaitUntil(mutex_, Clock::now() + often);
    const Clock::time_point now = Clock::now();
    for (const auto& [connection, deadline] : busy_) {
      std::chrono::milliseconds unanswered = options_.unanswered_timeout;
      if (now >= deadline) unanswered = std::min(unanswered, kLeastAnswer);
      if (now >= latest_) unanswered = std::min(unanswered, kMaxLate);
      connection->GiveUp(unanswered);
    }
  }
}

bool PostgresPool::Pause(std::chrono::milliseconds pause, Clock::time_point tried,
                         Clock::time_point deadline) {
  const Clock::time_point now = Clock::now();
  const Clock::time_point end = now + pause;
  if (end > deadline) return false;
  // What has taken long may do so again.
  if (now - tried >= kMaxLate && end + kMaxLate > deadline) return false;
  MutexLock lock(mutex_);
  while (!ending_ && Clock::now() < std::min(end, latest_)) {
    changed_.WaitUntil(mutex_, std::min(end, latest_));
  }
  return !ending_ && Clock::now() < latest_;
}

}  // namespace tissueform
