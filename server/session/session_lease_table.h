// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/mutex.h"
#include "server/session/worker_pool.h"

namespace tissueform {

// A server that is the only one to write to its store writes under this epoch: a store on disk is
// locked by it.
inline constexpr int64_t kSoleEpoch = 1;

// Which sessions of a shared store this server may answer and write. Other servers create, change
// and delete sessions of that store, too.
//
// Thread-safe.
class SessionOwnership {
 public:
  virtual ~SessionOwnership() = default;

  // Takes a session whose record is kept. From then on, until it is lost, this server may answer
  // and write it, under the epoch that is returned; where it holds the session already the epoch
  // stays. Blocks on the store.
  //
  // Errors: Unavailable with SESSION_MOVED (another server holds it, "node" in the metadata),
  // NotFound, those of the store.
  virtual absl::StatusOr<int64_t> Acquire(const std::string& id) = 0;

  // The epoch to write under; empty when this server may not answer the session. Fast, never
  // blocks.
  virtual std::optional<int64_t> EpochOf(const std::string& id) = 0;

  // Its record is gone: nothing is held of it, nor of the next one of its id. Never blocks.
  virtual void Forget(const std::string& id) = 0;

  // Others may take it at once. Blocks on the store; nothing happens where it is not held.
  virtual void Release(const std::string& id) = 0;
};

class SessionLeaseTable;

// A share in a session's lease, where servers share a store: code that makes, drags, watches or
// changes a session has such an object. With the last one of a session its lease is
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
// Thread-safe. Made by std::make_shared. Its lock comes after those of all other classes of
// sessions and before the pool's: a hold may end under any other lock. It is not held over the
// ownership.
class SessionLeaseTable : public std::enable_shared_from_this<SessionLeaseTable> {
 public:
  using TakenCallback = std::function<void(absl::StatusOr<SessionLeaseHandlePtr>)>;

  // `ownership` must outlive it and its holds, `pool` until Stop. Without an `ownership` (null) the
  // store is this server's own: nothing is taken, and everything is held.
  SessionLeaseTable(SessionOwnership* ownership, WorkerPool* pool)
      : ownership_(ownership), pool_(pool) {}

  bool shared() const { return ownership_ != nullptr; }

  // Takes a session whose record is kept, unless another server holds it: at once where the store
  // is not shared, else in Lane::kLeases. Errors: those of SessionOwnership::Acquire; Unavailable
  // (the server ends, or has begun to hand over).
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
  // Its record is gone; never blocks. REQUIRES: shared, as Release.
  void Forget(const std::string& id) { ownership_->Forget(id); }
  // Gives it back, regardless of its handles; blocks.
  void Release(const std::string& id) { ownership_->Release(id); }

  // From now on nothing is posted to the pool; leases run out.
  void Stop();

 private:
  friend class SessionLeaseHandle;
  using State = SessionLeaseHandle::State;

  // False after Stop.
  bool Post(WorkerPool::Job job) ABSL_LOCKS_EXCLUDED(mutex_);
  void End(const std::string& id, State* state) ABSL_LOCKS_EXCLUDED(mutex_);
  void ReleaseUnlessUsed(const std::string& id) ABSL_LOCKS_EXCLUDED(mutex_);
  void EraseIfIdle(const std::string& id) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  SessionOwnership* const ownership_;
  WorkerPool* const pool_;
  std::atomic<bool> stops_taking_ = false;

  mutable Mutex mutex_;
  bool stopped_ ABSL_GUARDED_BY(mutex_) = false;
  ConditionVariable released_;
  std::map<std::string, std::shared_ptr<State>> states_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
