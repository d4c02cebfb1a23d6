// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/held_leases.h"

#include <ctime>
#include <utility>

namespace tissueform {

std::chrono::steady_clock::time_point AwakeOrNotNow() {
  timespec now{};
  clock_gettime(CLOCK_BOOTTIME, &now);
  return std::chrono::steady_clock::time_point(std::chrono::seconds(now.tv_sec) +
                                               std::chrono::nanoseconds(now.tv_nsec));
}

std::optional<int64_t> HeldLeases::EpochOf(const std::string& session,
                                           std::chrono::steady_clock::time_point now) {
  MutexLock lock(mutex_);
  const auto found = leases_.find(session);
  if (found == leases_.end() || now >= found->second.answers_until) return std::nullopt;
  return found->second.epoch;
}

std::vector<std::string> HeldLeases::Sessions() {
  std::vector<std::string> sessions;
  MutexLock lock(mutex_);
  sessions.reserve(leases_.size());
  for (const auto& [session, lease] : leases_) sessions.push_back(session);
  return sessions;
}

std::vector<SessionLease> HeldLeases::Acquired(const std::string& session,
                                               const LeaseAnswer& answer) {
  std::vector<SessionLease> lost;
  MutexLock lock(mutex_);
  const auto found = leases_.find(session);
  if (found != leases_.end() && (!answer.mine || found->second.epoch != answer.lease.epoch)) {
    lost.push_back(std::move(found->second));
    leases_.erase(found);
  }
  if (answer.mine) leases_[session] = answer.lease;
  return lost;
}

std::optional<SessionLease> HeldLeases::Take(const std::string& session) {
  MutexLock lock(mutex_);
  const auto found = leases_.find(session);
  if (found == leases_.end()) return std::nullopt;
  SessionLease lease = std::move(found->second);
  leases_.erase(found);
  return lease;
}

std::vector<SessionLease> HeldLeases::Renewed(const std::vector<SessionLease>& renewed,
                                              std::vector<SessionLease>* strays) {
  std::vector<SessionLease> lost;
  MutexLock lock(mutex_);
  std::map<std::string, SessionLease> before = std::exchange(leases_, {});
  for (const SessionLease& lease : renewed) {
    const bool as_before = lease.answers_until == SessionLease::kAsBefore;
    const auto found = before.find(lease.session);
    if (found == before.end() || found->second.epoch != lease.epoch) {
      // One that was not renewed runs out.
      if (!as_before) strays->push_back(lease);
      continue;
    }
    leases_.emplace(lease.session, as_before ? found->second : lease);
    before.erase(found);
  }
  lost.reserve(before.size());
  for (auto& [session, lease] : before) lost.push_back(std::move(lease));
  return lost;
}

std::vector<SessionLease> HeldLeases::TakeEnded(std::chrono::steady_clock::time_point now) {
  std::vector<SessionLease> lost;
  MutexLock lock(mutex_);
  for (auto next = leases_.begin(); next != leases_.end();) {
    const auto lease = next++;
    if (now < lease->second.answers_until) continue;
    lost.push_back(std::move(lease->second));
    leases_.erase(lease);
  }
  return lost;
}

}  // namespace tissueform
