// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/mutex.h"
#include "server/session/clock.h"
#include "server/session/limits.h"
#include "server/session/memory_budget.h"
#include "server/session/session.h"
#include "server/session/shared_preparation.h"
#include "server/session/worker_pool.h"
#include "server/store/session_store.h"

namespace tissueform {

// The sessions of the server by their id: in memory, each with its record in a store.
//
// Thread-safe. Callbacks are called without a lock held, from the calling thread or from a worker.
class SessionRegistry {
 public:
  using CancelFlag = std::shared_ptr<const std::atomic<bool>>;
  using CreateCallback = std::function<void(absl::StatusOr<std::shared_ptr<Session>>)>;

  // All pointers must outlive the registry and all its sessions.
  SessionRegistry(const ServiceLimits& limits, MemoryBudget* budget, WorkerPool* pool,
                  SessionStore* store, const Clock* clock = Clock::System());

  // Makes a session of `record` on a worker, keeps the record and calls `done` once. A record
  // without id gets a random one. Calls with the same request id share one session; its making
  // stops early when `cancelled` is set for all who wait for it. `mesh` is the one that the record
  // names.
  //
  // Every successful answer is a claim on the session, see Abandon.
  //
  // Errors: those of Session::Create and SessionStore::Create; AlreadyExists (the id is taken);
  // ResourceExhausted (too many sessions); InvalidArgument (the request id belongs to another
  // request); Cancelled.
  void Create(SessionRecord record, std::shared_ptr<const StoredMesh> mesh, CancelFlag cancelled,
              const CreateCallback& done);

  // Answers those callers of Create at once with Cancelled who came with this flag and still wait;
  // what is made for nobody else stops at its next stage.
  void CancelCreate(const CancelFlag& cancelled);

  // Takes back one claim of a caller who never saw the answer. The session ends with its last
  // claim.
  void Abandon(const std::shared_ptr<Session>& session);

  // Errors: NotFound.
  absl::StatusOr<std::shared_ptr<Session>> Find(const std::string& id);

  // Calls `done` when the memory of the session is free and its record is gone. Errors: NotFound,
  // those of SessionStore::Delete.
  void Delete(const std::string& id, const std::function<void(absl::Status)>& done);

  // Ends the sessions that were idle for longer than the TTL. Returns how many.
  int RemoveIdle();

  int size() const;

 private:
  struct Waiter {
    CancelFlag cancelled;
    CreateCallback done;
  };
  // What makes a creation idempotent.
  struct RequestKey {
    std::string request_id;
    std::string fingerprint;
  };
  // A session that is being made.
  struct Creation {
    std::string id;
    RequestKey key;
    std::vector<Waiter> waiters;  // guarded by the mutex of the registry
  };
  struct Entry {
    std::shared_ptr<Session> session;
    RequestKey key;
    int claims = 0;
  };
  // What became of a call of Create when it arrived.
  struct Admission {
    absl::Status refusal;
    std::shared_ptr<Session> existing;
    std::shared_ptr<Creation> started;  // all three empty: joined a creation that is under way
  };

  Admission Admit(const SessionRecord& record, const Waiter& waiter) ABSL_LOCKS_EXCLUDED(mutex_);
  bool IsTaken(const std::string& id) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // False when no session and no creation has the request id.
  bool JoinEarlierRequest(const RequestKey& key, const Waiter& waiter, Admission* admission)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  bool Full() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // On the preparation's strand.
  void Make(const std::shared_ptr<Creation>& creation, SessionRecord record,
            std::shared_ptr<const StoredMesh> mesh, std::shared_ptr<SharedPreparation> preparation)
      ABSL_LOCKS_EXCLUDED(mutex_);
  bool AllCancelled(const Creation& creation) const ABSL_LOCKS_EXCLUDED(mutex_);
  void FinishCreation(const std::shared_ptr<Creation>& creation,
                      absl::StatusOr<std::shared_ptr<Session>> result) ABSL_LOCKS_EXCLUDED(mutex_);
  // Ends a session that was taken out, and its record.
  void End(const std::shared_ptr<Session>& session, const std::function<void(absl::Status)>& done)
      ABSL_LOCKS_EXCLUDED(mutex_);
  // Takes the record of a session that has ended out of the store; then its id is free again.
  void Forget(const std::string& id, std::function<void(absl::Status)> done)
      ABSL_LOCKS_EXCLUDED(mutex_);
  // Whoever takes a session forgets it in the end.
  std::shared_ptr<Session> Take(const std::string& id) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  // Constant.
  const ServiceLimits limits_;
  MemoryBudget* const budget_;
  WorkerPool* const pool_;
  SessionStore* const store_;
  const Clock* const clock_;

  // Self-synchronised.
  SharedPreparations preparations_;

  mutable Mutex mutex_;
  std::map<std::string, Entry> sessions_ ABSL_GUARDED_BY(mutex_);
  std::set<std::string> ending_ ABSL_GUARDED_BY(mutex_);  // taken out, but still in the store
  std::map<std::string, std::string> session_of_request_ ABSL_GUARDED_BY(mutex_);
  std::vector<std::shared_ptr<Creation>> creations_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
