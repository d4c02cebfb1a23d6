// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/calls/call_quotas.h"

#include <algorithm>
#include <chrono>

namespace tissueform {
namespace {

// So that a client that has tried at every chance is not refused for its first burst.
constexpr double kSecondsOfBurst = 2;
constexpr std::chrono::seconds kSweep{60};
constexpr std::chrono::seconds kPlaceFree{1};

}  // namespace

CallQuotas::CallQuotas(const Quotas& quotas, const Clock* clock)
    : quotas_(quotas),
      most_tokens_(kSecondsOfBurst * quotas.calls_per_second),
      clock_(clock),
      swept_at_(clock->Now()) {}

absl::Status CallQuotas::Begin(const std::string& principal, CallKind kind) {
  const Clock::TimePoint now = clock_->Now();
  MutexLock lock(mutex_);
  ForgetIdle(now);
  const auto [found, is_new] = accounts_.try_emplace(principal);
  Account& account = found->second;
  if (is_new) {
    account.tokens = most_tokens_;
    account.filled_at = now;
  }
  account.tokens = TokensAt(account, now);
  account.filled_at = now;
  if (account.tokens < 1) {
    const std::chrono::duration<double> wait((1 - account.tokens) / quotas_.calls_per_second);
    return QuotaExceeded("calls a second", "calls-per-second", quotas_.calls_per_second,
                         std::chrono::duration_cast<Clock::Duration>(wait));
  }
  const bool is_stream = kind == CallKind::kStream;
  int& open = is_stream ? account.streams : account.waiting;
  const int most = is_stream ? quotas_.streams : quotas_.waiting_calls;
  if (open >= most) {
    return is_stream ? QuotaExceeded("drags and watches at once", "streams", most, kPlaceFree)
                     : QuotaExceeded("calls at once", "waiting-calls", most, kPlaceFree);
  }
  account.tokens -= 1;
  ++open;
  return absl::OkStatus();
}

void CallQuotas::End(const std::string& principal, CallKind kind) {
  MutexLock lock(mutex_);
  Account& account = accounts_.at(principal);
  --(kind == CallKind::kStream ? account.streams : account.waiting);
}

int CallQuotas::open_streams(const std::string& principal) const {
  MutexLock lock(mutex_);
  const auto found = accounts_.find(principal);
  return found == accounts_.end() ? 0 : found->second.streams;
}

int64_t CallQuotas::num_principals() const {
  MutexLock lock(mutex_);
  return static_cast<int64_t>(accounts_.size());
}

double CallQuotas::TokensAt(const Account& account, Clock::TimePoint now) const {
  const std::chrono::duration<double> since = now - account.filled_at;
  return std::min(most_tokens_, account.tokens + since.count() * quotas_.calls_per_second);
}

void CallQuotas::ForgetIdle(Clock::TimePoint now) {
  if (now - swept_at_ < kSweep) return;
  swept_at_ = now;
  std::erase_if(accounts_, [&](const auto& entry) {
    const Account& account = entry.second;
    return TokensAt(account, now) >= most_tokens_ && account.waiting == 0 && account.streams == 0;
  });
}

}  // namespace tissueform
