// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/postgres_store/lease_keeper.h"

#include <utility>
#include <vector>

namespace tissueform {

LeaseKeeper::LeaseKeeper(SessionLeases* leases, Options options, LostCallback lost)
    : leases_(leases), options_(std::move(options)), lost_(std::move(lost)) {}

void LeaseKeeper::Stop() {
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
  std::vector<SessionLease> lost;
  absl::StatusOr<LeaseAnswer> answer;
  {
    MutexLock calls(calls_);
    answer = leases_->Acquire(session);
    if (!answer.ok()) return answer;
    lost = held_.Acquired(session, *answer);
  }
  TellLost(lost);
  return answer;
}

absl::Status LeaseKeeper::Release(const std::string& session) {
  MutexLock calls(calls_);
  const std::optional<SessionLease> lease = held_.Take(session);
  return lease.has_value() ? leases_->Release(session, lease->epoch) : absl::OkStatus();
}

absl::Status LeaseKeeper::ReleaseAll() {
  absl::Status first;
  for (const std::string& session : held_.Sessions()) first.Update(Release(session));
  return first;
}

std::optional<int64_t> LeaseKeeper::EpochOf(const std::string& session) {
  return held_.EpochOf(session, options_.clock());
}

absl::Status LeaseKeeper::Renew() {
  std::vector<SessionLease> lost;
  absl::Status status;
  {
    MutexLock calls(calls_);
    const absl::StatusOr<std::vector<SessionLease>> renewed = leases_->Renew();
    status = renewed.status();
    std::vector<SessionLease> strays;
    lost = renewed.ok() ? held_.Renewed(*renewed, &strays) : held_.TakeEnded(options_.clock());
    for (const SessionLease& stray : strays) {
      status.Update(leases_->Release(stray.session, stray.epoch));
    }
  }
  TellLost(lost);
  return status;
}

void LeaseKeeper::TellLost(const std::vector<SessionLease>& lost) {
  for (const SessionLease& lease : lost) lost_(lease);
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
