// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/mutex.h"
#include "server/store/postgres_store/held_leases.h"
#include "server/store/postgres_store/session_leases.h"

namespace tissueform {

// The sessions that this server holds: renews their leases, and knows at any time whether it may
// answer. A server that cannot renew stops answering before its leases end.
//
// Thread-safe.
class LeaseKeeper {
 public:
  struct Options {
    std::chrono::milliseconds renew_every{3'000};
    // After a call that the store did not answer, other calls than renewals fail at once with the
    // same error for this time, instead of waiting. After it renewing is tried again. A row that
    // others have locked is an answer.
    std::chrono::milliseconds silence{1'000};
    // After a renewal that has passed over a row that another call was writing: its lease should
    // not be shorter than the others' by a whole round.
    std::chrono::milliseconds again{200};
    SteadyNow clock = AwakeOrNotNow;
  };
  // A session is held no longer: its streams end (SESSION_MOVED), its memory is free. Called once
  // for each lease that is lost, without a lock held.
  using LostCallback = std::function<void(const SessionLease&)>;

  // `leases` must outlive it, and be used by nothing else.
  LeaseKeeper(SessionLeases* leases, Options options, LostCallback lost);
  // Ends renewing. Leases are not released: see ReleaseAll.
  ~LeaseKeeper() { Stop(); }
  LeaseKeeper(const LeaseKeeper&) = delete;
  LeaseKeeper& operator=(const LeaseKeeper&) = delete;

  // A thread renews from now on. Once.
  void Start();
  // Ends renewing: `lost` is not called for the leases that are lost by it.
  void Stop();

  // As SessionLeases::Acquire; where it is mine it is kept.
  absl::StatusOr<LeaseAnswer> Acquire(const std::string& session);
  absl::Status Release(const std::string& session);
  // The session is gone. Fast; `lost` is not called for its lease.
  void Forget(const std::string& session) { held_.Take(session); }
  // So that others go on at once: at the end of a drain. Errors: the first; tries all.
  absl::Status ReleaseAll();

  // The epoch to write under; empty when the session may not be answered. Fast.
  std::optional<int64_t> EpochOf(const std::string& session);

  int CountHeld() { return static_cast<int>(held_.Sessions().size()); }

  // What the thread does, and after how long it does so again. Errors: why nothing was renewed;
  // leases that have run out by then are lost nevertheless.
  absl::StatusOr<std::chrono::milliseconds> Renew();

 private:
  void Loop();
  // Of a call that may not ask so soon after one that was not answered.
  absl::Status Silence() ABSL_EXCLUSIVE_LOCKS_REQUIRED(calls_);
  // `answer`, remembered for that.
  absl::Status Asked(absl::Status answer) ABSL_EXCLUSIVE_LOCKS_REQUIRED(calls_);
  void ReportLost(const std::vector<SessionLease>& lost);

  SessionLeases* const leases_;
  const Options options_;
  const LostCallback lost_;

  // One call to the store at a time: what it says of all is newer than what is known of any.
  Mutex calls_;
  absl::Status silence_ ABSL_GUARDED_BY(calls_);
  std::chrono::steady_clock::time_point silent_until_ ABSL_GUARDED_BY(calls_);
  HeldLeases held_;

  Mutex mutex_;
  ConditionVariable changed_;
  bool ending_ ABSL_GUARDED_BY(mutex_) = false;

  std::thread thread_;
};

}  // namespace tissueform
