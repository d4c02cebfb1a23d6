// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/postgres_store/lease_keeper.h"

#include <utility>
#include <vector>

#include "core/base/status_macros.h"

namespace tissueform {

LeaseKeeper::LeaseKeeper(SessionLeases* leases, Options options, LostCallback lost)
    : leases_(leases), options_(std::move(options)), lost_(std::move(lost)) {}

LeaseKeeper::~LeaseKeeper() {
  {
    MutexLock lock(mutex_);
    ending_ = true;
    changed_.NotifyAll();
  }
  if (thread_.joinable()) thread_.join();
}

void LeaseKeeper::Start() {
  thread_ = std::thread([this] { Loop(); });
}

absl::StatusOr<LeaseAnswer> LeaseKeeper::Acquire(const std::string& session) {
  std::map<std::string, SessionLease> lost;
  absl::StatusOr<LeaseAnswer> answer;
  {
    MutexLock calls(calls_);
    answer = leases_->Acquire(session);
    if (!answer.ok()) return answer;
    MutexLock lock(mutex_);
    const auto found = held_.find(session);
    // Another epoch: what was made under the one before has been somebody else's in between.
    if (found != held_.end() && (!answer->mine || found->second.epoch != answer->lease.epoch)) {
      lost.insert(held_.extract(found));
    }
    if (answer->mine) held_[session] = answer->lease;
  }
  TellLost(lost);
  return answer;
}

absl::Status LeaseKeeper::Release(const std::string& session) {
  MutexLock calls(calls_);
  SessionLease lease;
  {
    MutexLock lock(mutex_);
    const auto found = held_.find(session);
    if (found == held_.end()) return absl::OkStatus();
    lease = found->second;
    held_.erase(found);
  }
  return leases_->Release(session, lease.epoch);
}

absl::Status LeaseKeeper::ReleaseAll() {
  std::vector<std::string> sessions;
  {
    MutexLock lock(mutex_);
    for (const auto& [session, lease] : held_) sessions.push_back(session);
  }
  absl::Status first;
  for (const std::string& session : sessions) first.Update(Release(session));
  return first;
}

std::optional<int64_t> LeaseKeeper::EpochOf(const std::string& session) {
  const auto now = options_.clock();
  MutexLock lock(mutex_);
  const auto found = held_.find(session);
  if (found == held_.end() || now >= found->second.answers_until) return std::nullopt;
  return found->second.epoch;
}

absl::Status LeaseKeeper::Renew() {
  std::map<std::string, SessionLease> lost;
  absl::Status status;
  {
    MutexLock calls(calls_);
    const absl::StatusOr<std::vector<SessionLease>> renewed = leases_->Renew();
    status = renewed.status();
    if (status.ok()) {
      std::vector<SessionLease> strays;
      lost = TakeOver(*renewed, &strays);
      for (const SessionLease& stray : strays) {
        status.Update(leases_->Release(stray.session, stray.epoch));
      }
    } else {
      lost = TakeOutEnded();
    }
  }
  TellLost(lost);
  return status;
}

std::map<std::string, SessionLease> LeaseKeeper::TakeOver(const std::vector<SessionLease>& renewed,
                                                          std::vector<SessionLease>* strays) {
  MutexLock lock(mutex_);
  std::map<std::string, SessionLease> lost = std::exchange(held_, {});
  for (const SessionLease& lease : renewed) {
    const auto found = lost.find(lease.session);
    if (found == lost.end() || found->second.epoch != lease.epoch) {
      strays->push_back(lease);
      continue;
    }
    lost.erase(found);
    held_.emplace(lease.session, lease);
  }
  return lost;
}

std::map<std::string, SessionLease> LeaseKeeper::TakeOutEnded() {
  const auto now = options_.clock();
  std::map<std::string, SessionLease> lost;
  MutexLock lock(mutex_);
  for (auto next = held_.begin(); next != held_.end();) {
    const auto lease = next++;
    if (now >= lease->second.answers_until) lost.insert(held_.extract(lease));
  }
  return lost;
}

void LeaseKeeper::TellLost(const std::map<std::string, SessionLease>& lost) {
  for (const auto& [session, lease] : lost) lost_(lease);
}

void LeaseKeeper::Loop() {
  for (;;) {
    const auto next = std::chrono::steady_clock::now() + options_.renew_every;
    {
      MutexLock lock(mutex_);
      while (!ending_ && std::chrono::steady_clock::now() < next) {
        changed_.WaitUntil(mutex_, next);
      }
      if (ending_) return;
    }
    // Why not, the next call of somebody says; what runs out is told in any case.
    Renew().IgnoreError();
  }
}

}  // namespace tissueform
