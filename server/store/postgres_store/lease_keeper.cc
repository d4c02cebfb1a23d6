// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/lease_keeper.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "server/store/postgres_store/postgres_errors.h"

namespace tissueform {
namespace {

bool IsAsBefore(const SessionLease& lease) {
  return lease.answers_until == SessionLease::kAsBefore;
}

}  // namespace

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
    TF_RETURN_IF_ERROR(Silence());
    answer = leases_->Acquire(session);
    TF_RETURN_IF_ERROR(Asked(answer.status()));
    lost = held_.Acquired(session, *answer);
  }
  ReportLost(lost);
  return answer;
}

absl::Status LeaseKeeper::Release(const std::string& session) {
  MutexLock calls(calls_);
  const std::optional<SessionLease> lease = held_.Take(session);
  if (!lease.has_value()) return absl::OkStatus();
  TF_RETURN_IF_ERROR(Silence());
  return Asked(leases_->Release(session, lease->epoch));
}

absl::Status LeaseKeeper::Silence() {
  return options_.clock() < silent_until_ ? silence_ : absl::OkStatus();
}

absl::Status LeaseKeeper::Asked(absl::Status answer) {
  if (absl::IsUnavailable(answer) && !OthersHoldRows(answer)) {
    silence_ = answer;
    silent_until_ = options_.clock() + options_.silence;
  } else {
    silent_until_ = {};
  }
  return answer;
}

absl::Status LeaseKeeper::ReleaseAll() {
  absl::Status first;
  for (const std::string& session : held_.Sessions()) first.Update(Release(session));
  return first;
}

std::optional<int64_t> LeaseKeeper::EpochOf(const std::string& session) {
  return held_.EpochOf(session, options_.clock());
}

absl::StatusOr<std::chrono::milliseconds> LeaseKeeper::Renew() {
  std::vector<SessionLease> lost;
  absl::Status status;
  std::chrono::milliseconds next = options_.renew_every;
  {
    MutexLock calls(calls_);
    const absl::StatusOr<std::vector<SessionLease>> renewed = leases_->Renew();
    status = Asked(renewed.status());
    std::vector<SessionLease> strays;
    lost = renewed.ok() ? held_.Renewed(*renewed, &strays) : held_.TakeEnded(options_.clock());
    for (const SessionLease& stray : strays) {
      status.Update(leases_->Release(stray.session, stray.epoch));
    }
    if (renewed.ok() && std::any_of(renewed->begin(), renewed->end(), IsAsBefore)) {
      next = std::min(next, options_.again);
    }
  }
  ReportLost(lost);
  TF_RETURN_IF_ERROR(status);
  return next;
}

void LeaseKeeper::ReportLost(const std::vector<SessionLease>& lost) {
  for (const SessionLease& lease : lost) lost_(lease);
}

void LeaseKeeper::Loop() {
  std::chrono::milliseconds pause = options_.renew_every;
  for (;;) {
    const auto next = std::chrono::steady_clock::now() + pause;
    {
      MutexLock lock(mutex_);
      while (!ending_ && std::chrono::steady_clock::now() < next) {
        changed_.WaitUntil(mutex_, next);
      }
      if (ending_) return;
    }
    // The next call for a session reports why it failed; what runs out is reported in any case.
    pause = Renew().value_or(std::min(options_.renew_every, options_.silence));
  }
}

}  // namespace tissueform
