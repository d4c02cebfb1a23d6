// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/postgres_session_leases.h"

#include <utility>

#include "core/base/random_id.h"
#include "core/base/status_macros.h"
#include "server/store/store_errors.h"

namespace tissueform {
namespace {

constexpr size_t kMaxSeen = 10'000;

}  // namespace

PostgresSessionLeases::PostgresSessionLeases(PostgresPool* pool, std::string node,
                                             LeaseOptions options, SteadyNow clock)
    : pool_(pool),
      node_(std::move(node)),
      holder_(RandomId()),
      options_(options),
      clock_(std::move(clock)) {}

// From before it was asked: the database's lease began later, and ends later.
SessionLease PostgresSessionLeases::LeaseFrom(std::chrono::steady_clock::time_point asked,
                                              std::string session, int64_t epoch) const {
  return {.session = std::move(session),
          .epoch = epoch,
          .answers_until = asked + options_.duration - options_.margin};
}

absl::Status PostgresSessionLeases::Run(const PostgresPool::Work& work) {
  // Who holds a session already keeps its epoch, and releases what it holds under that alone.
  return pool_->Run(work, PostgresPool::Clock::now() + options_.patience,
                    PostgresPool::Idempotent::kYes);
}

std::string PostgresSessionLeases::SeenTooLong(const std::string& session) {
  MutexLock lock(mutex_);
  const auto found = seen_.find(session);
  if (found == seen_.end() || clock_() < found->second.since + options_.duration) return "";
  return found->second.lease_until;
}

void PostgresSessionLeases::NoteSeen(const std::string& session, const std::string& too_late) {
  MutexLock lock(mutex_);
  if (too_late.empty()) {
    seen_.erase(session);
    return;
  }
  if (seen_.size() >= kMaxSeen) seen_.clear();
  Seen& seen = seen_[session];
  if (seen.lease_until != too_late) seen = {.lease_until = too_late, .since = clock_()};
}

absl::StatusOr<LeaseAnswer> PostgresSessionLeases::Acquire(const std::string& session) {
  const auto asked = clock_();
  const std::string seen = SeenTooLong(session);
  LeaseAnswer answer;
  std::string too_late;
  TF_RETURN_IF_ERROR(Run([&](PostgresTransaction& transaction) -> absl::Status {
    TF_ASSIGN_OR_RETURN(
        const SqlRows taken,
        transaction.Query(
            "UPDATE session_states SET epoch = CASE WHEN holder = $2 AND lease_until > "
            "tissueform_now() THEN epoch ELSE nextval('session_epochs') END, holder = $2, node = "
            "$3, lease_until = tissueform_now() + $4::bigint * interval '1 millisecond' WHERE key "
            "= "
            "(SELECT key FROM sessions WHERE id = $1) AND (holder = $2 OR lease_until <= "
            "tissueform_now() OR lease_until::text = $5) RETURNING epoch",
            {session, holder_, node_, int64_t{options_.duration.count()}, seen}));
    answer = {};
    too_late.clear();
    if (!taken.empty()) {
      answer.mine = true;
      answer.lease = LeaseFrom(asked, session, taken.Integer(0, 0));
      return absl::OkStatus();
    }
    TF_ASSIGN_OR_RETURN(
        const SqlRows held,
        transaction.Query(
            "SELECT node, CASE WHEN lease_until > tissueform_now() + $2::bigint * interval '1 "
            "millisecond' THEN lease_until::text ELSE '' END FROM session_states JOIN sessions ON "
            "sessions.key = session_states.key WHERE id = $1",
            {session, int64_t{2 * options_.duration.count()}}));
    if (held.empty()) return NoSession(session);
    answer.node = std::string(held.Text(0, 0));
    too_late = std::string(held.Text(0, 1));
    return absl::OkStatus();
  }));
  NoteSeen(session, too_late);
  return answer;
}

absl::StatusOr<std::vector<SessionLease>> PostgresSessionLeases::Renew() {
  const auto asked = clock_();
  std::vector<SessionLease> leases;
  TF_RETURN_IF_ERROR(Run([&](PostgresTransaction& transaction) -> absl::Status {
    leases.clear();
    // Where one row is locked by others the leases of all others would wait, and run out, with it.
    TF_ASSIGN_OR_RETURN(
        const SqlRows rows,
        transaction.Query(
            "WITH mine AS (SELECT key FROM session_states WHERE holder = $1 AND lease_until > "
            "tissueform_now() ORDER BY key FOR UPDATE SKIP LOCKED), renewed AS (UPDATE "
            "session_states SET lease_until = tissueform_now() + $2::bigint * interval '1 "
            "millisecond' FROM mine WHERE session_states.key = mine.key RETURNING "
            "session_states.key, epoch) SELECT id, epoch, 1 FROM renewed JOIN sessions ON "
            "sessions.key = renewed.key UNION ALL SELECT id, epoch, 0 FROM session_states JOIN "
            "sessions ON sessions.key = session_states.key WHERE holder = $1 AND lease_until > "
            "tissueform_now() AND session_states.key NOT IN (SELECT key FROM renewed)",
            {holder_, int64_t{options_.duration.count()}}));
    leases.reserve(rows.size());
    for (size_t row = 0; row < rows.size(); ++row) {
      leases.push_back(LeaseFrom(asked, std::string(rows.Text(row, 0)), rows.Integer(row, 1)));
      if (rows.Integer(row, 2) == 0) leases.back().answers_until = SessionLease::kAsBefore;
    }
    return absl::OkStatus();
  }));
  return leases;
}

absl::Status PostgresSessionLeases::Release(const std::string& session, int64_t epoch) {
  return Run([&](PostgresTransaction& transaction) {
    return transaction.Run(
        "UPDATE session_states SET lease_until = '-infinity' WHERE key = (SELECT key FROM sessions "
        "WHERE id = $1) AND holder = $2 AND epoch = $3",
        {session, holder_, epoch});
  });
}

}  // namespace tissueform
