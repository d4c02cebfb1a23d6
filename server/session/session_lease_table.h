// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/mutex.h"
#include "server/session/session_ownership.h"
#include "server/session/worker_pool.h"

namespace tissueform {

class SessionLeaseTable;

// Somebody's part in it that this server holds a session of a store that it shares: whoever makes,
// drags, watches or changes one has such an object. With the last one of a session its lease is
// given back. Thread-safe.
class SessionLeaseHandle {
 public:
  // What all holds of a session have in common.
  struct State {
    std::atomic<bool> given_up = false;
    // Guarded by the SessionLeaseTable.
    int holds = 0;           // those that live, and those that are being taken
    bool is_taken = false;   // since it was given back last
    bool releasing = false;  // a call that gives it back is under way
  };

  SessionLeaseHandle(std::shared_ptr<SessionLeaseTable> holds, std::shared_ptr<State> state,
                     std::string id, int64_t epoch)
      : holds_(std::move(holds)), state_(std::move(state)), id_(std::move(id)), epoch_(epoch) {}
  ~SessionLeaseHandle();
  SessionLeaseHandle(const SessionLeaseHandle&) = delete;
  SessionLeaseHandle& operator=(const SessionLeaseHandle&) = delete;

  const std::string& id() const { return id_; }  // the session's
  // Under which the session is written.
  int64_t epoch() const { return epoch_; }

  // Whether the session may be answered and written under this epoch. Fast, never blocks, takes
  // only the ownership's own lock. Errors: Unavailable with SESSION_MOVED.
  absl::Status Check() const;

 private:
  const std::shared_ptr<SessionLeaseTable> holds_;
  const std::shared_ptr<State> state_;
  const std::string id_;
  const int64_t epoch_;
};
// Null where the store is this server's own: then there is nothing to hold.
using SessionLeaseHandlePtr = std::shared_ptr<const SessionLeaseHandle>;
inline int64_t EpochUnder(const SessionLeaseHandlePtr& hold) {
  return hold == nullptr ? kSoleEpoch : hold->epoch();
}
inline absl::Status CheckHold(const SessionLeaseHandlePtr& hold) {
  return hold == nullptr ? absl::OkStatus() : hold->Check();
}

// The sessions that this server holds, counted by those who need them; no call that gives one back
// meets one that takes it.
//
// Thread-safe. Made by std::make_shared. What ends a hold may hold any lock but that of the pool.
class SessionLeaseTable : public std::enable_shared_from_this<SessionLeaseTable> {
 public:
  using TakenCallback = std::function<void(absl::StatusOr<SessionLeaseHandlePtr>)>;

  // `ownership` must outlive it and its holds, `pool` until Stop.
  SessionLeaseTable(SessionOwnership* ownership, WorkerPool* pool)
      : ownership_(ownership), pool_(pool), shared_(ownership->is_shared()) {}

  bool shared() const { return shared_; }

  // Takes a session whose record is kept, where nobody else holds it: at once where the store is
  // not shared, else in Lane::kLeases. Errors: those of SessionOwnership::Acquire; Unavailable (the
  // server ends, or has begun to hand over).
  void Take(const std::string& id, const TakenCallback& done);
  // The same; blocks.
  absl::StatusOr<SessionLeaseHandlePtr> TakeAndWait(const std::string& id);
  // Of a session that is not held, though its record is kept since this epoch: Check says so.
  // REQUIRES: shared.
  SessionLeaseHandlePtr NotHeld(const std::string& id, int64_t epoch);
  // Whether it may be answered and written under some epoch.
  bool Holds(const std::string& id) const;

  // Ends a hold; `then`, in Lane::kLeases or at once, when others may take the session if it was
  // the last one.
  void GiveBack(SessionLeaseHandlePtr hold, const std::function<void()>& then);

  // Nothing is taken from now on.
  void StopTaking() { stops_taking_ = true; }
  std::vector<std::string> Held() const;
  // From now on this server does not answer the session, though its lease is not given back.
  void GiveUp(const std::string& id);
  // Its record is gone; never blocks.
  void Forget(const std::string& id) { ownership_->Forget(id); }
  // Gives it back, whoever holds it; blocks.
  void Release(const std::string& id) { ownership_->Release(id); }

  // Nothing is posted to the pool any longer; leases run out.
  void Stop();

 private:
  friend class SessionLeaseHandle;
  using State = SessionLeaseHandle::State;

  bool Post(WorkerPool::Job job) ABSL_LOCKS_EXCLUDED(pool_mutex_);
  void End(const std::string& id, State* state) ABSL_LOCKS_EXCLUDED(mutex_);
  void ReleaseUnlessUsed(const std::string& id) ABSL_LOCKS_EXCLUDED(mutex_);
  void EraseIfIdle(const std::string& id) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  SessionOwnership* const ownership_;
  WorkerPool* const pool_;
  const bool shared_;
  std::atomic<bool> stops_taking_ = false;

  Mutex pool_mutex_;  // innermost but for the pool's
  bool stopped_ ABSL_GUARDED_BY(pool_mutex_) = false;

  mutable Mutex mutex_;
  ConditionVariable released_;
  std::map<std::string, std::shared_ptr<State>> states_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
